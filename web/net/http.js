// Requests to the daemon's API. Not the WebSocket (socket.js), not what an answer means.
// The rule: every refusal becomes an ApiError with the daemon's own code and words; silence becomes one too.

import { CLIENT } from "./client.js";

export const API = "/api/v1";
const ANSWER_MS = 20_000; // a machine that is asked may take its time; a daemon that is gone must not take for ever

/** A refusal of the daemon (RFC 9457), or none at all (`code` is then "unreachable"). */
export class ApiError extends Error {
  /** @param {number} status @param {any} body */
  constructor(status, body) {
    super(body.detail || body.title || `HTTP ${status}`);
    this.status = status;
    this.code = body.code ?? "unknown";
    this.body = body;
  }
}

/**
 * @param {string} method
 * @param {string} path below /api/v1
 * @param {any} [body] sent as JSON
 * @param {{headers?: Record<string, string>, withinMs?: number, signal?: AbortSignal}} [options]
 * @returns {Promise<any>}
 */
export async function request(method, path, body, options = {}) {
  const late = AbortSignal.timeout(options.withinMs ?? ANSWER_MS);
  // `any` is younger than the rest of what is used here, and the e-stop must not hang on it.
  const signal = options.signal ? AbortSignal.any([late, options.signal]) : late;
  /** @type {Record<string, string>} */
  const headers = { "Millstream-Client": CLIENT, ...options.headers };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  let response;
  try {
    response = await fetch(API + path, {
      method, headers, signal, body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new ApiError(0, { code: "unreachable", detail: "The daemon does not answer." });
  }
  const answer = await parsed(response);
  if (!response.ok) throw new ApiError(response.status, answer ?? {});
  return answer;
}

/** @param {Response} response */
async function parsed(response) {
  if (response.status === 204) return null;
  try {
    return await response.json();
  } catch {
    return null;
  }
}

/** @param {string} path @param {{withinMs?: number, signal?: AbortSignal}} [options] */
export const get = (path, options) => request("GET", path, undefined, options);
/** @param {string} path @param {any} [body] @param {{headers?: Record<string, string>, withinMs?: number}} [options] */
export const post = (path, body, options) => request("POST", path, body, options);

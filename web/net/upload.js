// A file on its way to the daemon, with its progress, which `fetch` does not tell.
// The rule: the file is sent as it is; what it is worth, the daemon says.

import { API, ApiError } from "./http.js";

/**
 * @param {File} file
 * @param {(part: number) => void} progress 0 to 1
 * @param {AbortSignal} stop breaks it off
 * @returns {Promise<import("../types.js").Program | null>} null: it was broken off
 */
export function upload(file, progress, stop) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `${API}/programs?name=${encodeURIComponent(file.name)}`);
    request.responseType = "json";
    request.upload.addEventListener("progress", (event) => { if (event.lengthComputable) progress(event.loaded / event.total); });
    request.addEventListener("load", () => {
      if (request.status >= 200 && request.status < 300) resolve(request.response);
      else reject(new ApiError(request.status, request.response ?? {}));
    });
    request.addEventListener("error", () => reject(new ApiError(0, { code: "unreachable", detail: `${file.name}: the upload broke off.` })));
    request.addEventListener("abort", () => resolve(null));
    stop.addEventListener("abort", () => request.abort());
    request.send(file);
  });
}

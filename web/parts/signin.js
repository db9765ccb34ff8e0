// Signing in with a token. The rule: the token is sent once and kept nowhere in the page; the cookie is out of its reach.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { daemon } from "../net/daemon.js";
import { post } from "../net/http.js";

export function SignIn() {
  const [token, setToken] = useState("");
  const [refused, setRefused] = useState("");
  async function submit(/** @type {Event} */ event) {
    event.preventDefault();
    try {
      await post("/session", { token: token.trim() });
      setToken("");
      daemon.start();
    } catch (error) {
      setRefused(error instanceof Error ? error.message : String(error));
    }
  }
  return html`<main class="sign-in">
    <form class="panel" onSubmit=${submit}>
      <h1><img src="/web/icon.svg" alt="" width="32" height="32" /> millstream</h1>
      <p>${t("signin.text")} <code>millstream token create</code></p>
      <label>${t("signin.token")}
        <input type="password" name="token" autocomplete="current-password" required maxlength="512" value=${token}
          onInput=${(/** @type {any} */ event) => setToken(event.target.value)} /></label>
      ${refused && html`<p class="problem" role="alert">${refused}</p>`}
      <button type="submit" class="button primary">${t("signin.button")}</button>
    </form>
  </main>`;
}

// The SD card in the controller: its files, and running one. The rule: the controller is asked only when somebody asks,
// for it must stand still for that.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { go, to } from "../lib/router.js";
import { get, post } from "../net/http.js";
import { against, chosen } from "../state/store.js";
import { Button } from "../parts/button.js";

export function CardPage() {
  const [card, setCard] = useState(/** @type {{card: string | null, names: string[], problem: string | null} | null} */ (null));
  const reason = against("sd"), unread = against("read");
  const path = `/machines/${encodeURIComponent(chosen.value ?? "")}/sd`;
  return html`<section class="panel card" aria-label=${t("card.title")}>
    <header><h2>${t("card.title")} <small>${card?.card ?? ""}</small></h2>
      <${Button} name="read-card" icon="reset" label=${t("card.read")} reason=${unread}
        onPress=${async () => setCard(await get(path, { withinMs: 30_000 }))} /></header>
    ${card === null && html`<p class="empty">${t("card.unread")}</p>`}
    ${card !== null && (card.problem || card.card === null) && html`<p class="problem">${card.problem ?? t("card.none")}</p>`}
    ${card !== null && card.card !== null && card.names.length === 0 && html`<p class="empty">${t("card.empty")}</p>`}
    <ul class="program-list">${card?.names.map((name) => html`<li key=${name}><span class="name">${name}</span>
      <${Button} icon="play" label=${t("card.run")} reason=${reason} quiet
        onPress=${async () => { await post(`${path}/run`, { name }); go(to("machine")); }} /></li>`)}</ul>
  </section>`;
}

// Icons, drawn here: one path each, 24 by 24, in the colour of the text around.
// The rule: an icon never stands alone where it means something; there is a word beside it, or an accessible name.

import { html } from "../lib/ui.js";

/** @type {Record<string, string>} */
const PATHS = {
  idle: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M8 12.3l2.8 2.8L16.2 9.6",
  run: "M8 5.2v13.6L19 12z",
  hold: "M8.5 5v14M15.5 5v14",
  jog: "M12 3v18M3 12h18M12 3 9.6 5.6M12 3l2.4 2.6M12 21l-2.4-2.6M12 21l2.4-2.6M3 12l2.6-2.4M3 12l2.6 2.4M21 12l-2.6-2.4M21 12l-2.6 2.4",
  alarm: "M12 3.5 2.8 20h18.4zM12 10v5M12 17.3v.4",
  home: "M4 11.5 12 4l8 7.5M6.5 9.5V20h11V9.5M10 20v-6h4v6",
  check: "M7 4h10v16H7zM9.8 12.2l1.7 1.7 3-3.4",
  door: "M6 21V3.5h9V21M3.5 21h17M15 6l4 2v13M12.3 12v.6",
  sleep: "M19.5 14.5A8 8 0 0 1 9.5 4.5a8 8 0 1 0 10 10z",
  tool: "M14.5 4.5a4.6 4.6 0 0 0-4 6.3L4.4 17 7 19.6l6.2-6.1a4.6 4.6 0 0 0 6-5.6l-2.7 2.6-2.7-.7-.7-2.7z",
  offline: "M9 7V3.5M15 7V3.5M7 7h10v4a5 5 0 0 1-10 0zM12 16v4.5M3.5 3.5l17 17",
  connecting: "M12 3.5a8.5 8.5 0 1 0 8.5 8.5M12 7.5V12l3 2",
  interrupted: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M9.4 9.4a2.7 2.7 0 1 1 3.9 2.4c-.9.5-1.3 1-1.3 2M12 16.7v.4",
  stop: "M6.5 6.5h11v11h-11z",
  play: "M8 5.2v13.6L19 12z",
  pause: "M8.5 5v14M15.5 5v14",
  unlock: "M6 11h12v9H6zM8.5 11V7.5a3.5 3.5 0 0 1 6.8-1.2",
  reset: "M4.5 12a7.5 7.5 0 1 0 2.4-5.5M4.5 4.5v4h4",
  up: "M12 19V5M6 11l6-6 6 6", down: "M12 5v14M6 13l6 6 6-6", left: "M19 12H5M11 6l-6 6 6 6", right: "M5 12h14M13 6l6 6-6 6",
  file: "M6.5 3h7.5l4 4v14h-11.5zM14 3v4h4",
  upload: "M12 16V5M7 10l5-5 5 5M4 19h16",
  list: "M8.5 6.5H20M8.5 12H20M8.5 17.5H20M4.3 6.5h.4M4.3 12h.4M4.3 17.5h.4",
  terminal: "M3.5 5h17v14h-17zM7 9.5l2.5 2.5L7 14.5M12 15h4.5",
  card: "M7.5 3h10v18h-11V7zM9.5 4.5v3M12 4.5v3M14.5 4.5v3",
  sliders: "M5 4v7M5 15v5M12 4v3M12 11v9M19 4v9M19 17v3M3 13h4M10 9h4M17 15h4",
  gauge: "M4 17.5a9 9 0 1 1 16 0M12 14l4-5",
  sound: "M4 9.5h3.5L12 5.5v13l-4.5-4H4zM15 9a4.4 4.4 0 0 1 0 6M17.5 6.5a8 8 0 0 1 0 11",
  mute: "M4 9.5h3.5L12 5.5v13l-4.5-4H4zM15.5 9.5l5 5M20.5 9.5l-5 5",
  keyboard: "M3 6.5h18v11H3zM6.3 10h.4M10 10h.4M13.7 10h.4M17.3 10h.4M7.5 14h9",
  plus: "M12 5v14M5 12h14",
  minus: "M5 12h14",
  cube: "M12 3l8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12L4 7.5",
  chart: "M4 4v16h16M7.5 15l3.5-5 3.5 3 5-7",
  more: "M12 5.5v.5M12 12v.5M12 18.5v.5",
  close: "M5.5 5.5l13 13M18.5 5.5l-13 13",
  save: "M12 4v11M7 10.5l5 5 5-5M4 19.5h16",
  trash: "M5 7h14M9.5 7V4h5v3M7 7l.8 13h8.4L17 7",
  target: "M12 5a7 7 0 1 0 0 14 7 7 0 0 0 0-14M12 2v5M12 17v5M2 12h5M17 12h5",
};

/** @param {{name: string, size?: number}} props */
export function Icon({ name, size = 24 }) {
  return html`<svg class="icon" viewBox="0 0 24 24" width=${size} height=${size} aria-hidden="true" focusable="false">
    <path d=${PATHS[name] ?? PATHS.interrupted} /></svg>`;
}

// One plot over time: uPlot in a component. The library is loaded when the first plot is opened.
// The rule: a gap is a gap; the colours are those of the page.

import { html, useEffect, useRef } from "../lib/ui.js";
import { time } from "../lib/i18n.js";
import { theme } from "../lib/prefs.js";

const HEIGHT_PX = 170;
const AXIS_PX = 62;
const COLOURS = ["--plot-1", "--plot-2", "--plot-3", "--plot-4", "--plot-5", "--plot-6"];

/** @type {Promise<typeof import("../vendor/uplot.js")> | null} */
let library = null;

/** @param {HTMLElement} host @param {number} count of rows @param {typeof import("../vendor/uplot.js").default} Plotter */
function plotIn(host, count, Plotter) {
  const style = getComputedStyle(host), colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--faint"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line"), width: 1 }, font: "13px system-ui, sans-serif" };
  const series = COLOURS.slice(0, count).map((name) => ({ stroke: colour(name), width: 2, points: { show: false }, spanGaps: false }));
  return new Plotter({
    width: Math.max(host.clientWidth, 200), height: HEIGHT_PX, legend: { show: false }, cursor: { show: false }, pxAlign: false,
    scales: { x: { time: true, auto: false }, y: { range: (/** @type {unknown} */ _, /** @type {number} */ low, /** @type {number} */ high) => roomy(low, high) } },
    axes: [{ ...axis, size: 34, space: 90, values: (/** @type {unknown} */ _, /** @type {number[]} */ at) => at.map((one) => time(new Date(one * 1000))) }, { ...axis, size: AXIS_PX }],
    series: [{}, ...series],
  }, [[], ...series.map(() => [])], host);
}

/** A line that does not move lies in the middle, not on the edge. @param {number | null} low @param {number | null} high */
function roomy(low, high) {
  if (low === null || high === null) return [0, 1];
  const room = Math.max((high - low) * 0.08, Math.abs(high) * 0.02, 0.5);
  return [low >= 0 && low < room ? 0 : low - room, high + room];
}

/** @param {{name: string, rows: (number | null)[][], from: number, to: number}} props rows: times, then each line */
export function Plot({ name, rows, from, to }) {
  const host = useRef(/** @type {HTMLElement | null} */ (null));
  const plot = useRef(/** @type {import("../vendor/uplot.js").default | null} */ (null));
  const latest = useRef({ rows, from, to });
  latest.current = { rows, from, to };
  const show = () => {
    plot.current?.setData(latest.current.rows, false);
    plot.current?.setScale("x", { min: latest.current.from, max: latest.current.to });
  };
  const colours = theme.value, lines = rows.length - 1;
  useEffect(() => {
    const on = /** @type {HTMLElement} */ (host.current);
    let left = false;
    library ??= import("../vendor/uplot.js");
    library.then(({ default: Plotter }) => {
      if (left) return;
      plot.current = plotIn(on, lines, Plotter);
      show();
    }, () => { library = null; });
    const resized = new ResizeObserver(() => plot.current?.setSize({ width: Math.max(on.clientWidth, 200), height: HEIGHT_PX }));
    resized.observe(on);
    return () => {
      left = true;
      resized.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [lines, colours]);
  useEffect(show);
  return html`<div ref=${host} class="plot" data-name=${`plot-${name}`} data-points=${rows[0].length}></div>`;
}

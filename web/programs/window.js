// A box with a scroll bar over any number of rows, as a hook: where it stands, and how it is moved. Not the arithmetic
// (scroll.js), not the rows. The rule: the true offset is kept here; the bar only shows it, and only a person moves it.

import { useLayoutEffect, useRef, useState } from "../lib/ui.js";
import { inSight, measures, ROW_PX, within } from "./scroll.js";

const FIRST_VIEW_PX = 480; // until the box is there

/** @param {number} rows */
export function useWindow(rows) {
  const [, redraw] = useState(0);
  const again = () => redraw((n) => n + 1);
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const offset = useRef(0);
  const viewPx = box.current?.clientHeight ?? FIRST_VIEW_PX;
  const { pagePx, scale } = measures(rows, viewPx);

  function move(/** @type {number} */ px) {
    offset.current = within(px, box.current?.clientHeight ?? viewPx, rows);
    if (box.current) box.current.scrollTop = offset.current / scale;
    again();
  }
  function onScroll() {
    const top = box.current?.scrollTop ?? 0;
    // What `move` has set comes back rounded; only a person's own scrolling is more than that.
    if (Math.abs(top - offset.current / scale) <= 1) return;
    offset.current = top * scale;
    again();
  }
  function onWheel(/** @type {WheelEvent} */ event) {
    if (scale === 1 || event.ctrlKey) return;
    event.preventDefault();
    move(offset.current + event.deltaY * (event.deltaMode === 1 ? ROW_PX : 1));
  }
  function onKeyDown(/** @type {KeyboardEvent} */ event) {
    /** @type {Record<string, number>} */
    const by = { ArrowDown: ROW_PX, ArrowUp: -ROW_PX, PageDown: viewPx - ROW_PX, PageUp: ROW_PX - viewPx, Home: -Infinity, End: Infinity };
    if (!(event.key in by)) return;
    event.preventDefault();
    move(offset.current + by[event.key]);
  }
  useLayoutEffect(() => {
    const on = box.current;
    if (!on) return undefined;
    again();
    const grown = new ResizeObserver(again);
    grown.observe(on);
    on.addEventListener("wheel", onWheel, { passive: false });
    return () => {
      grown.disconnect();
      on.removeEventListener("wheel", onWheel);
    };
  }, [scale]);
  const { first, last } = inSight(offset.current, viewPx, rows);
  const shiftPx = first * ROW_PX - offset.current + offset.current / scale;
  const show = (/** @type {number} */ row) => move(row * ROW_PX - viewPx / 3);
  return { box, first, last, pagePx, shiftPx, show, onScroll, onKeyDown };
}

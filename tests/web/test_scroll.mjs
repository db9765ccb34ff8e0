// Scrolling through any number of rows (web/programs/scroll.js), and words for figures (web/lib/format.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { clock, coordinate, csv, remaining, size } from "./web/lib/format.js";
import { HIGHEST_PX, inSight, measures, ROW_PX, within } from "./web/programs/scroll.js";

const VIEW = 600;

test("the bar's ends are the program's ends, whatever its length", () => {
  for (const rows of [1, 10, 25, 26, 1000, 208_333, 208_334, 1_000_000, 50_000_000]) {
    const { pagePx, scale } = measures(rows, VIEW);
    assert.ok(pagePx <= HIGHEST_PX);
    const bottom = Math.max(0, pagePx - VIEW) * scale;
    assert.ok(Math.abs(bottom - within(Infinity, VIEW, rows)) < 1, `${rows} rows end at ${bottom}`);
    const { first, last } = inSight(within(Infinity, VIEW, rows), VIEW, rows);
    assert.equal(last, rows - 1);
    assert.ok(first >= 0 && last - first < VIEW / ROW_PX + 4);
  }
});

test("every row can be reached by steps of one row", () => {
  for (const rows of [40, 300_000]) {
    for (const row of [0, 1, 17, rows >> 1, rows - 1]) {
      const { first, last } = inSight(within(row * ROW_PX, VIEW, rows), VIEW, rows);
      assert.ok(first <= row && row <= last);
    }
  }
});

test("figures", () => {
  assert.deepEqual([0, -0.0001, 12.34567, -3].map(coordinate), ["0.000", "0.000", "12.346", "-3.000"]);
  assert.deepEqual([0, 59.6, 61, 3600, 36_061].map(clock), ["0:00", "1:00", "1:01", "1:00:00", "10:01:01"]);
  assert.deepEqual([0, 1023, 1024, 1536, 20 * 1024, 3 * 1024 ** 3].map(size), ["0 B", "1023 B", "1.0 KiB", "1.5 KiB", "20 KiB", "3.0 GiB"]);
  const left = (least, best, most) => remaining({ seconds_left: best, seconds_left_min: least, seconds_left_max: most });
  assert.deepEqual([left(null, null, null), left(95, 100, 105), left(60, 100, 200)], [null, "≈ 1:40", "1:00 – 3:20"]);
});

test("a table survives what is in it, and is no formula", () => {
  const rows = [{ a: 'say "hi"', b: -3, c: null }, { a: "=1+1", b: "x,y\nz", c: { d: 1 } }];
  assert.equal(csv(["a", "b", "c"], rows), 'a,b,c\r\n"say ""hi""",-3,\r\n\'=1+1,"x,y\nz","{""d"":1}"\r\n');
});

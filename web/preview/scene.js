// The drawing: path, tool, reach of the machine, ground. The only file that knows three.js; it lives in the worker, so that
// even a browser that draws without a graphics card keeps its page quick. The rule: it draws when something has changed,
// never by itself; while it is being turned, a path that is too slow for that is drawn by its coarse level.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, ConeGeometry, EdgesGeometry, LineBasicMaterial, LineSegments, Mesh,
  MeshBasicMaterial, OrthographicCamera, Scene as Stage, Vector3, WebGLRenderer,
} from "../vendor/three.module.js";
import { basis } from "./eye.js";
import { doneOf } from "./path.js";

/**
 * @typedef {"cut" | "rapid"} Look
 * @typedef {"coarse" | "fine"} Quality
 * @typedef {{width: number, height: number, ratio: number}} Size
 */

const LOOKS = /** @type {const} */ (["cut", "rapid"]);
const SMOOTH_MS = 40; // longer than that for a picture is no turning
const TOOL_PX = 26;
const DEEP = 40; // times what is drawn, before and behind the target
const ARMS = /** @type {const} */ ([["x", 1, 0, 0], ["y", 0, 1, 0], ["z", 0, 0, 1]]);

/** One level of the path: the same corners, cut and rapid, each done and still to do. */
class Path {
  /** @param {Float32Array} positions @param {Record<string, any>} materials */
  constructor(positions, materials) {
    const corners = new BufferAttribute(positions, 3);
    /** How long a picture takes, ms; null: not measured. @type {number | null} */
    this.tookMs = null;
    /** @type {Record<Look, Uint32Array>} */
    this.lines = { cut: new Uint32Array(0), rapid: new Uint32Array(0) };
    this.parts = LOOKS.map((look) => {
      const geometry = new BufferGeometry().setAttribute("position", corners);
      const part = new LineSegments(geometry, [materials[`${look}_done`], materials[look]]);
      part.frustumCulled = false;
      return { look, part };
    });
  }

  /** @param {import("./path.js").Drawing} drawing @param {number} line that is done */
  show(drawing, line) {
    for (const { look, part } of this.parts) {
      part.geometry.setIndex(new BufferAttribute(drawing[look].index, 1));
      this.lines[look] = drawing[look].lines;
    }
    this.paint(line);
  }

  /** @param {number} line that is done */
  paint(line) {
    for (const { look, part } of this.parts) {
      const lines = this.lines[look], done = doneOf(lines, line);
      part.geometry.clearGroups();
      if (done) part.geometry.addGroup(0, 2 * done, 0);
      if (done < lines.length) part.geometry.addGroup(2 * done, 2 * (lines.length - done), 1);
    }
  }

  dispose() {
    for (const { part } of this.parts) part.geometry.dispose();
  }
}

/** Whether the pictures are made by the processor. @param {OffscreenCanvas} canvas for trying */
function slowly(canvas) {
  const gl = canvas.getContext("webgl2"), info = gl?.getExtension("WEBGL_debug_renderer_info");
  return Boolean(gl && info && /swiftshader|llvmpipe|software|basic render/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)));
}

export class Scene {
  /** @param {OffscreenCanvas} canvas @param {Size} size @param {(level: Quality, count: number) => void} onDrawn */
  constructor(canvas, size, onDrawn) {
    this.onDrawn = onDrawn;
    const slow = slowly(new OffscreenCanvas(1, 1));
    this.renderer = new WebGLRenderer({ canvas, antialias: !slow, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(slow ? 1 : size.ratio);
    this.stage = new Stage();
    this.camera = new OrthographicCamera(-1, 1, 1, -1, -1, 1);
    this.camera.matrixAutoUpdate = false;
    const faint = { transparent: true, depthWrite: false };
    /** @type {Record<string, import("../vendor/three.module.js").Material>} */
    this.materials = {
      cut: new LineBasicMaterial(), cut_done: new LineBasicMaterial(), rapid: new LineBasicMaterial({ ...faint, opacity: 0.6 }),
      rapid_done: new LineBasicMaterial({ ...faint, opacity: 0.25 }), grid: new LineBasicMaterial(), reach: new LineBasicMaterial(),
      tool: new MeshBasicMaterial({ transparent: true, opacity: 0.9 }),
      x: new LineBasicMaterial(), y: new LineBasicMaterial(), z: new LineBasicMaterial(),
    };
    /** @type {Partial<Record<Quality, Path>>} */
    this.paths = {};
    this.tool = new Mesh(new ConeGeometry(0.32, 1, 24).rotateX(-Math.PI / 2).translate(0, 0, 0.5), this.materials.tool);
    this.tool.visible = false;
    this.stage.add(this.tool);
    /** @type {LineSegments | null} */
    this.reach = null;
    this.reachKey = "null";
    this.origin = [0, 0, 0];
    this.deep = 1;
    this.line = 0;
    this.turning = false;
    /** @type {import("./eye.js").Eye} */
    this.eye = { target: [0, 0, 0], azimuth: 0, polar: 0, mmPerPx: 1 };
    this.drawn = 0;
    this.asked = false;
    this.size = size;
    this.setSize(size);
  }

  /** @param {Record<string, string>} colours by what they are of */
  setColours(colours) {
    for (const [name, colour] of Object.entries(colours)) this.materials[name]?.color.set(colour);
    this.draw();
  }

  /** @param {Size} size */
  setSize(size) {
    this.size = size;
    this.renderer.setSize(size.width, size.height, false);
    this.draw();
  }

  /** @param {import("./eye.js").Eye} eye @param {boolean} turning */
  setEye(eye, turning) {
    this.eye = eye;
    this.turning = turning;
    this.draw();
  }

  /** What the drawing begins with. @param {number[]} origin @param {(number[] | null)[]} bounds */
  begin(origin, bounds) {
    this.origin = origin;
    const ranges = bounds.map((range, axis) => (range ?? [0, 0]).map((end) => end - origin[axis]));
    this.deep = DEEP * (Math.hypot(...ranges.map(([low, high]) => high - low)) + 1);
    const step = gridStep(Math.max(...ranges.slice(0, 2).map(([low, high]) => high - low)));
    const [x, y] = ranges.map(([low, high]) => [Math.floor(low / step) * step, Math.ceil(high / step) * step]);
    /** @type {Vector3[]} */
    const points = [], floor = -origin[2];
    for (let at = x[0]; at <= x[1] + step / 2; at += step) points.push(new Vector3(at, y[0], floor), new Vector3(at, y[1], floor));
    for (let at = y[0]; at <= y[1] + step / 2; at += step) points.push(new Vector3(x[0], at, floor), new Vector3(x[1], at, floor));
    this.stage.add(new LineSegments(new BufferGeometry().setFromPoints(points), this.materials.grid));
    const zero = new Vector3(-origin[0], -origin[1], -origin[2]);
    for (const [axis, ...way] of ARMS) {
      const end = new Vector3(way[0], way[1], way[2]).multiplyScalar(2 * step).add(zero);
      this.stage.add(new LineSegments(new BufferGeometry().setFromPoints([zero, end]), this.materials[axis]));
    }
  }

  /** @param {Quality} quality @param {Float32Array} positions less the origin @param {import("./path.js").Drawing} drawing */
  setPath(quality, positions, drawing) {
    const before = this.paths[quality];
    for (const { part } of before?.parts ?? []) this.stage.remove(part);
    before?.dispose();
    const path = new Path(positions, this.materials);
    this.paths[quality] = path;
    for (const { part } of path.parts) this.stage.add(part);
    this.setDrawing(quality, drawing);
  }

  /** @param {Quality} quality @param {import("./path.js").Drawing} drawing */
  setDrawing(quality, drawing) {
    this.paths[quality]?.show(drawing, this.line);
    this.draw();
  }

  /** @param {number} line that is certainly done, 0: none */
  setLine(line) {
    this.line = line;
    for (const path of Object.values(this.paths)) path.paint(line);
    this.draw();
  }

  /** @param {number[] | null} at mm in the drawing */
  setTool(at) {
    this.tool.visible = at !== null;
    if (at) this.tool.position.set(at[0] - this.origin[0], at[1] - this.origin[1], at[2] - this.origin[2]);
    this.draw();
  }

  /** @param {import("./place.js").Box | null} box the machine's reach, mm in the drawing */
  setReach(box) {
    const key = JSON.stringify(box);
    if (key === this.reachKey) return;
    this.reachKey = key;
    if (this.reach) {
      this.stage.remove(this.reach);
      this.reach.geometry.dispose();
      this.reach = null;
    }
    if (box) {
      const size = box.high.map((high, axis) => Math.max(high - box.low[axis], 1e-3));
      const middle = box.low.map((low, axis) => low + size[axis] / 2 - this.origin[axis]);
      const solid = new BoxGeometry(size[0], size[1], size[2]);
      this.reach = new LineSegments(new EdgesGeometry(solid).translate(middle[0], middle[1], middle[2]), this.materials.reach);
      solid.dispose();
      this.stage.add(this.reach);
    }
    this.draw();
  }

  /** With the next picture, however often it is asked for. */
  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.render();
    });
  }

  render() {
    const { coarse, fine } = this.paths;
    const shown = fine && !(this.turning && coarse && (fine.tookMs ?? 0) > SMOOTH_MS) ? fine : coarse;
    for (const path of [coarse, fine]) for (const { part } of path?.parts ?? []) part.visible = path === shown;
    this.aim();
    const size = TOOL_PX * this.eye.mmPerPx;
    this.tool.scale.set(size, size, size);
    this.renderer.render(this.stage, this.camera);
    this.drawn += 1;
    this.onDrawn(shown === fine && fine ? "fine" : "coarse", this.drawn);
  }

  aim() {
    const { target, mmPerPx } = this.eye, { right, up, back } = basis(this.eye), { camera } = this;
    camera.right = (this.size.width / 2) * mmPerPx;
    camera.top = (this.size.height / 2) * mmPerPx;
    camera.left = -camera.right;
    camera.bottom = -camera.top;
    camera.near = -this.deep;
    camera.far = this.deep;
    camera.updateProjectionMatrix();
    const [x, y, z] = target.map((at, axis) => at - this.origin[axis]);
    camera.matrix.set(right[0], up[0], back[0], x, right[1], up[1], back[1], y, right[2], up[2], back[2], z, 0, 0, 0, 1);
    camera.updateMatrixWorld(true);
  }

  /** How long a picture of that level takes on this device, ms. The second one: the first makes the programs of the card. */
  async measure(/** @type {Quality} */ quality) {
    const path = this.paths[quality];
    if (!path) return 0;
    for (const { part } of path.parts) part.visible = true;
    for (let times = 0; times < 2; times++) {
      const began = performance.now();
      this.aim();
      this.renderer.render(this.stage, this.camera);
      await finished(this.renderer.getContext());
      path.tookMs = performance.now() - began;
    }
    this.draw();
    return path.tookMs ?? 0;
  }
}

/** When the card has done all that it was told, without holding up anything. @param {WebGL2RenderingContext} gl */
async function finished(gl) {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (!fence) return;
  gl.flush();
  while (!gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) await new Promise((go) => { setTimeout(go, 2); });
  gl.deleteSync(fence);
}

/** 1, 2 or 5 times a power of ten: about a dozen of them are `wide`. @param {number} wide mm */
function gridStep(wide) {
  const rough = Math.max(wide, 1) / 12, power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5].map((times) => times * power).find((step) => step >= rough) ?? 10 * power;
}

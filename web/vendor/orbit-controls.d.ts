// Hand-written: what web/preview/ takes from the library, no more.
import type { OrthographicCamera, Vector3 } from "./three.module.js";
export class OrbitControls {
  constructor(camera: OrthographicCamera, element: HTMLElement);
  target: Vector3;
  enableDamping: boolean;
  zoomToCursor: boolean;
  minZoom: number;
  maxZoom: number;
  update(): boolean;
  listenToKeyEvents(element: HTMLElement): void;
  addEventListener(type: "change" | "start" | "end", heard: () => void): void;
  dispose(): void;
}

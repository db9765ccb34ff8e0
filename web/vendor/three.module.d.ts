// Hand-written: what web/preview/ takes from the library, no more.
export class Vector3 {
  constructor(x?: number, y?: number, z?: number);
  x: number; y: number; z: number;
  set(x: number, y: number, z: number): this;
  copy(other: Vector3): this;
  add(other: Vector3): this;
  sub(other: Vector3): this;
  multiplyScalar(factor: number): this;
  normalize(): this;
  length(): number;
  project(camera: OrthographicCamera): this;
}
export class Color { constructor(colour: string | number); set(colour: string | number): this; }
export class Quaternion { copy(other: Quaternion): this; }
export class Object3D {
  position: Vector3; up: Vector3; scale: Vector3; quaternion: Quaternion; rotation: { x: number; y: number; z: number };
  visible: boolean; frustumCulled: boolean; renderOrder: number;
  add(...children: Object3D[]): this;
  remove(...children: Object3D[]): this;
  lookAt(at: Vector3): void;
}
export class Group extends Object3D {}
export class Scene extends Object3D {}
export class OrthographicCamera extends Object3D {
  constructor(left: number, right: number, top: number, bottom: number, near: number, far: number);
  left: number; right: number; top: number; bottom: number; near: number; far: number; zoom: number;
  updateProjectionMatrix(): void;
}
export class BufferAttribute {
  constructor(array: ArrayLike<number>, itemSize: number);
  needsUpdate: boolean;
}
export class BufferGeometry {
  setAttribute(name: string, attribute: BufferAttribute): this;
  setIndex(index: BufferAttribute | null): this;
  setFromPoints(points: Vector3[]): this;
  clearGroups(): void;
  addGroup(start: number, count: number, material: number): void;
  rotateX(radians: number): this;
  translate(x: number, y: number, z: number): this;
  dispose(): void;
}
export class ConeGeometry extends BufferGeometry { constructor(radius: number, height: number, segments?: number); }
export class BoxGeometry extends BufferGeometry { constructor(width: number, height: number, depth: number); }
export class EdgesGeometry extends BufferGeometry { constructor(of: BufferGeometry); }
export class Material { color: Color; dispose(): void; }
export class LineBasicMaterial extends Material { constructor(options?: object); }
export class MeshBasicMaterial extends Material { constructor(options?: object); }
export class LineSegments extends Object3D {
  constructor(geometry: BufferGeometry, material: Material | Material[]);
  geometry: BufferGeometry; material: Material | Material[];
}
export class Mesh extends Object3D {
  constructor(geometry: BufferGeometry, material: Material);
  geometry: BufferGeometry; material: Material;
}
export class WebGLRenderer {
  constructor(options: object);
  domElement: HTMLCanvasElement;
  setPixelRatio(ratio: number): void;
  setSize(width: number, height: number, style?: boolean): void;
  render(scene: Scene, camera: OrthographicCamera): void;
  dispose(): void;
  forceContextLoss(): void;
}

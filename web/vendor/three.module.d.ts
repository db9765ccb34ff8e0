// Hand-written: what web/preview/ takes from the library, no more.
export class Vector3 {
  constructor(x?: number, y?: number, z?: number);
  x: number; y: number; z: number;
  set(x: number, y: number, z: number): this;
  add(other: Vector3): this;
  multiplyScalar(factor: number): this;
}
export class Color { set(colour: string | number): this; }
export class Matrix4 { set(...rows: number[]): this; }
export class Object3D {
  position: Vector3; up: Vector3; scale: Vector3; matrix: Matrix4; matrixAutoUpdate: boolean;
  visible: boolean; frustumCulled: boolean; renderOrder: number;
  add(...children: Object3D[]): this;
  remove(...children: Object3D[]): this;
  updateMatrixWorld(force?: boolean): void;
}
export class Scene extends Object3D {}
export class OrthographicCamera extends Object3D {
  constructor(left: number, right: number, top: number, bottom: number, near: number, far: number);
  left: number; right: number; top: number; bottom: number; near: number; far: number;
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
  setPixelRatio(ratio: number): void;
  setSize(width: number, height: number, style?: boolean): void;
  render(scene: Scene, camera: OrthographicCamera): void;
  getContext(): WebGL2RenderingContext;
}

// Hand-written: what web/telemetry/ takes from the library, no more.
export type Row = (number | null)[] | Float64Array;
export default class uPlot {
  constructor(options: object, data: Row[], place: HTMLElement);
  readonly over: HTMLElement;
  setData(data: Row[], resetScales?: boolean): void;
  setScale(name: string, range: { min: number; max: number }): void;
  setSize(size: { width: number; height: number }): void;
  destroy(): void;
}

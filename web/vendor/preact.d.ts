// Hand-written: what web/lib/ui.js takes from the library, no more.
export type Child = unknown;
export function h(type: unknown, props: unknown, ...children: Child[]): unknown;
export function render(node: unknown, parent: Element): void;

// Hand-written: what web/lib/ui.js takes from the library, no more.
declare const htm: {
  bind(h: unknown): (strings: TemplateStringsArray, ...values: unknown[]) => unknown;
};
export default htm;

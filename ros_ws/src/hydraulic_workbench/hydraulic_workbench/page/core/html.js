// Templates: every value that is put into one becomes text or an attribute, never markup.
export { html, svg, nothing, render } from "../vendor/lit-html/lit-html.js";
export { repeat } from "../vendor/lit-html/directives/repeat.js";
export { live } from "../vendor/lit-html/directives/live.js";
export { ref } from "../vendor/lit-html/directives/ref.js";
export { keyed } from "../vendor/lit-html/directives/keyed.js";
export { classMap } from "../vendor/lit-html/directives/class-map.js";
export { styleMap } from "../vendor/lit-html/directives/style-map.js";
export { ifDefined } from "../vendor/lit-html/directives/if-defined.js";

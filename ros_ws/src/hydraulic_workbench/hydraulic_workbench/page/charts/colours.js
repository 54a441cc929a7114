// Colours of curves: from the style sheet, so that they follow the theme.

/** Value of a colour of the style sheet. */
export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Names of the curves' colours, in the order in which they are given out. */
export const PALETTE = ["curve-1", "curve-2", "curve-3", "curve-4", "curve-5", "curve-6"];

/** The same quantity has the same colour everywhere: what was measured, what a model says, what was asked for. */
export function colourOf(key, place = 0) {
  if (key.startsWith("predicted")) return "curve-2";
  if (key.startsWith("residual")) return "curve-4";
  if (key.startsWith("reference") || key === "command" || key === "pressure_supply") return "curve-6";
  if (key === "pressure_b") return "curve-3";
  return PALETTE[place % PALETTE.length];
}

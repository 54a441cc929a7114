// What all plots share: axes that read on light and dark, and a scale that does not tremble.
import { css } from "./colours.js";
import { digits } from "../core/format.js";

/** Width of a value axis. */
export const AXIS_PX = 54;
const FONT = '11.5px system-ui, "DejaVu Sans", sans-serif';

export function axis(more = {}) {
  return {
    stroke: () => css("soft"),
    font: FONT,
    grid: { stroke: () => css("grid"), width: 1 },
    ticks: { show: false },
    gap: 6,
    ...more,
  };
}

/** A value axis as wide as its neighbours', so that plots stand in line. */
export const valueAxis = (more = {}) => axis({ size: AXIS_PX, space: 22, values: (_, ticks) => labels(ticks), ...more });

/** Labels of ticks, all with as many places as the distance between them asks for. */
function labels(ticks) {
  const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : 1;
  let places = 0;
  while (places < 8 && Math.abs(step * 10 ** places - Math.round(step * 10 ** places)) > 1e-3) places += 1;
  return ticks.map((tick) => tick.toFixed(places).replace("-", "−"));
}

export const timeAxis = (more = {}) => axis({ size: 30, space: 70, values: (_, ticks) => labels(ticks).map((text) => `${text} s`), ...more });

/** A range of values that grows at once and shrinks only when much of it is empty. */
export function steadyRange(least = () => 0) {
  let low = 0;
  let high = 0;
  return (_, min, max) => {
    if (min === null || max === null || !Number.isFinite(min) || !Number.isFinite(max)) return low < high ? [low, high] : [-1, 1];
    const size = Math.max(span(min, max), least());
    const roomy = size < 0.45 * (high - low);
    if (!(low < high) || min < low || max > high || roomy) {
      low = (min + max - 1.2 * size) / 2;
      high = (min + max + 1.2 * size) / 2;
    }
    return [low, high];
  };
}

/** A range with a little room around the values. */
export function looseRange(_, min, max, room = 0.12) {
  if (min === null || !Number.isFinite(min)) return [-1, 1];
  const size = (1 + room) * span(min, max);
  return [(min + max - size) / 2, (min + max + size) / 2];
}

/** How much values differ; of a constant one, as much as keeps its axis readable. */
function span(min, max) {
  const size = Math.max(Math.abs(min), Math.abs(max));
  return max - min > 1e-7 * size && max > min ? max - min : Math.max(1, 0.02 * size);
}

export const number = (value) => digits(value, 4);

// Where the error is: its mean and its spread over a variable, in bins that open the samples behind them.
import { html } from "../core/html.js";
import { digits } from "../core/format.js";

/**
 * `map`: {start, end, center, mean, low, high, count} in SI; `value` and `error` say how both are shown ({factor, unit, title});
 * `chosen` is the number of the bin that is open; `choose(bin, low, high)` opens one.
 */
export function errorMap({ map, value, error, chosen, choose }) {
  const bins = map.center.map((_, k) => k).filter((k) => map.count[k] > 0 && map.mean[k] !== null);
  if (!bins.length) return html`<p class="soft small">No samples.</p>`;
  const most = Math.max(...bins.flatMap((k) => [Math.abs(map.low[k] ?? 0), Math.abs(map.high[k] ?? 0), Math.abs(map.mean[k])]), 1e-30);
  const top = (y) => `${50 - (46 * Math.max(-1.05, Math.min(1.05, y / most)))}%`;
  const text = (k) => `${value.title} ${digits(map.center[k] * value.factor, 3)} ${value.unit}: mean error `
    + `${digits(map.mean[k] * error.factor, 3)} ${error.unit}, ${map.count[k]} samples`;
  return html`<div class="map" role="group" aria-label=${`Error of ${error.title} over ${value.title}`}>
    <div class="scale"><span>${digits(most * error.factor, 2)}</span><span>${error.unit}</span><span>${digits(-most * error.factor, 2)}</span></div>
    <div class="bins">
      <span class="zero" style="top:50%"></span>
      ${bins.map((k) => html`<button aria-pressed=${chosen === k} title=${text(k)} aria-label=${text(k)}
          @click=${() => choose(k, map.start[k], map.end[k])}>
        <span class="spread" style=${`top:${top(map.high[k] ?? map.mean[k])};bottom:calc(100% - ${top(map.low[k] ?? map.mean[k])})`}></span>
        <span class="mean" style=${`top:${top(map.mean[k])}`}></span>
      </button>`)}
    </div>
    <div class="under"><span>${digits(map.center[bins[0]] * value.factor, 3)}</span><span>${value.title} [${value.unit}]</span>
      <span>${digits(map.center[bins[bins.length - 1]] * value.factor, 3)}</span></div>
  </div>`;
}

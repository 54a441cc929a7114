// The error as it falls: residual over noise, from left to right, down to the line where only noise is left.
import { html, nothing } from "../core/html.js";
import { digits } from "../core/format.js";

/** Height of a residual over noise in per cent: logarithmic, the noise near the bottom. */
function height(value, most) {
  const low = Math.log(0.6);
  const high = Math.log(Math.max(most, 1.5));
  return 76 * Math.max(0.04, (Math.log(Math.max(value, 0.6)) - low) / (high - low));
}

/** `steps`: [{value, title}], each what is left after it. */
export function fallingSteps(steps) {
  const all = steps.filter((step) => Number.isFinite(step.value));
  if (!all.length) return nothing;
  const most = Math.max(...all.map((step) => step.value));
  const text = all.map((step) => `${step.title}: ${digits(step.value, 3)} × noise`).join("; ");
  return html`<div class="falling" role="img" aria-label=${`Residual. ${text}`}>
    <div class="bars">
      <span class="noise" style=${`bottom:${height(1, most)}%`}><span>noise</span></span>
      ${all.map((step) => html`<div class="bar ${step.value < 1.1 ? "at-noise" : ""}" style=${`height:${height(step.value, most)}%`}>
        <b>${digits(step.value, 3)} ×</b></div>`)}
    </div>
    <div class="names">${all.map((step) => html`<span>${step.title}</span>`)}</div>
  </div>`;
}

/** While a job runs: what it has said of the residual so far. */
export function falling(job) {
  const values = (job.residual ?? []).filter(Number.isFinite);
  if (!values.length) return nothing;
  const shown = values.length > 8 ? [values[0], ...values.slice(-7)] : values;
  return fallingSteps(shown.map((value, k) => ({ value, title: k === 0 ? "before" : k === shown.length - 1 ? "now" : "" })));
}

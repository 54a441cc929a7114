// What the model does with a plan, between the limits of the bench.
import { html, nothing } from "../core/html.js";
import { digits } from "../core/format.js";
import "../charts/series_chart.js";

const charts = new WeakMap(); // document → charts, so that the same ones are drawn once

const DISPLAY = {
  position: { unit: "mm", factor: 1000 }, velocity: { unit: "mm/s", factor: 1000 },
  pressure: { unit: "bar", factor: 1e-5 }, drive: { unit: "V", factor: 1 },
};

function limitLines(range, factor, name) {
  if (!range) return [];
  return range.filter((value) => value !== null && Number.isFinite(value))
    .map((value) => ({ value: value * factor, title: `${name} ${digits(value * factor, 3)}`, colour: "poor" }));
}

function build({ traces, limits = {} }) {
  const line = (key, title, kind, colour) => ({ title, time: traces.time, value: traces[key], factor: DISPLAY[kind].factor, colour });
  const has = (key) => traces[key]?.some((value) => value !== null);
  const one = (title, kind, series, lines) => ({ title, unit: DISPLAY[kind].unit, sync: "rehearsal", height: 165, series, lines });
  const result = [
    one("Position", "position", [line("position", "position", "position", "curve-1")],
      [...limitLines(limits.travel, 1000, "limit"), ...limitLines(limits.stroke, 1000, "end of stroke").map((all) => ({ ...all, colour: "soft" }))]),
    one("Drive", "drive", [line("drive", "drive", "drive", "curve-6")],
      Number.isFinite(limits.drive) ? limitLines([-limits.drive, limits.drive], 1, "limit") : []),
  ];
  if (has("pressure_a") || has("pressure_b")) {
    const series = ["a", "b"].filter((side) => has(`pressure_${side}`))
      .map((side, k) => line(`pressure_${side}`, `pressure ${side.toUpperCase()}`, "pressure", ["curve-1", "curve-3"][k]));
    result.splice(1, 0, one("Pressures", "pressure", series, limitLines(limits.pressure, 1e-5, "limit")));
  }
  return result;
}

export function rehearsalCharts(doc) {
  if (!doc?.traces) return nothing;
  if (!charts.has(doc)) charts.set(doc, build(doc));
  return html`<section class="card" aria-label="Rehearsal"><header><h2>Rehearsal on ${doc.model?.name ?? "the model"}</h2>
      <span class="soft small">nothing has moved</span></header>
    ${charts.get(doc).map((chart) => html`<series-chart .chart=${chart}></series-chart>`)}</section>`;
}

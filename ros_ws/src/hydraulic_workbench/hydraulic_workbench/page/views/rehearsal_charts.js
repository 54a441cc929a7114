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
  const has = (key) => traces[key]?.value.some((value) => value !== null);
  const line = (key, title, kind, colour) => ({
    title, time: traces[key].time, value: traces[key].value, factor: DISPLAY[kind].factor, colour,
  });
  const one = (title, kind, keys, lines) => {
    const colours = kind === "drive" ? ["curve-6"] : ["curve-1", "curve-3"];
    const series = Object.entries(keys).filter(([key]) => has(key)).map(([key, name], k) => line(key, name, kind, colours[k]));
    return { title, unit: DISPLAY[kind].unit, sync: "rehearsal", height: 165, series, lines };
  };
  const stroke = limitLines(limits.stroke, 1000, "end of stroke").map((all) => ({ ...all, colour: "soft", left: true }));
  const drive = Number.isFinite(limits.drive) ? [-limits.drive, limits.drive] : null;
  return [
    one("Position", "position", { position: "position" }, [...limitLines(limits.travel, 1000, "limit"), ...stroke]),
    one("Pressures", "pressure", { pressure_a: "pressure A", pressure_b: "pressure B" }, limitLines(limits.pressure, 1e-5, "limit")),
    one("Velocity", "velocity", { velocity: "velocity" }, []),
    one("Drive", "drive", { drive: "drive" }, limitLines(drive, 1, "limit")),
  ].filter((chart) => chart.series.length);
}

export function rehearsalCharts(doc) {
  if (!doc?.traces) return nothing;
  if (!charts.has(doc)) charts.set(doc, build(doc));
  return html`<section class="card" aria-label="Rehearsal"><header><h2>Rehearsal on ${doc.model?.name ?? "the model"}</h2>
      <span class="soft small">nothing has moved</span></header>
    ${charts.get(doc).map((chart) => html`<series-chart .chart=${chart}></series-chart>`)}</section>`;
}

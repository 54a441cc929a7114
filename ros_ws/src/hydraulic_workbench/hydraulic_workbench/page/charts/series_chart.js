// Curves that stand still: rehearsals, records laid over each other, curves before and after.
// Drag to zoom, double click for the whole; charts of one `sync` zoom and point together.
import uPlot from "../vendor/uplot/uPlot.esm.js";
import { css } from "./colours.js";
import { looseRange, timeAxis, valueAxis } from "./axes.js";
import { digits } from "../core/format.js";

const groups = new Map(); // sync → charts
let dragged = null; // the plot in which the pointer went down

export class SeriesChart extends HTMLElement {
  /**
   * `chart`: {title, unit, height, sync, series: [{title, time, value, factor, colour, dash, width}],
   * lines: [{value, title, colour}], bands: [{from, to, title}], onZoom}. Another object draws it anew.
   */
  set chart(chart) {
    if (this.spec === chart) return;
    this.spec = chart;
    if (this.isConnected) this.build();
  }

  connectedCallback() {
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(this);
    this.recolour = () => this.plot?.redraw(false);
    addEventListener("theme", this.recolour);
    if (this.spec) this.build();
  }

  disconnectedCallback() {
    this.observer.disconnect();
    removeEventListener("theme", this.recolour);
    this.drop();
  }

  drop() {
    groups.get(this.sync)?.delete(this);
    this.plot?.destroy();
    this.plot = null;
    this.replaceChildren();
  }

  build() {
    this.drop();
    const { spec } = this;
    this.sync = spec.sync;
    if (spec.sync) groups.set(spec.sync, (groups.get(spec.sync) ?? new Set()).add(this));
    const series = spec.series.filter((one) => one.time?.length);
    this.body = document.createElement("div");
    this.append(this.head(series), this.body);
    if (!series.length) {
      this.body.className = "soft small";
      this.body.textContent = "Nothing to draw.";
      return;
    }
    this.shown = series;
    this.data = together(series);
    this.whole = [this.data[0][0], this.data[0][this.data[0].length - 1]];
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", `${spec.title ?? "Curves"}: ${series.map((one) => one.title).join(", ")}`);
    this.fit();
  }

  head(series) {
    const head = document.createElement("div");
    head.className = "panel-head";
    const title = document.createElement("h3");
    title.textContent = this.spec.title ?? "";
    const unit = document.createElement("span");
    unit.className = "soft small";
    unit.textContent = this.spec.unit ? `[${this.spec.unit}]` : "";
    head.append(title, unit);
    this.values = series.map((one, k) => {
      const button = document.createElement("button");
      button.className = "legend";
      button.setAttribute("aria-pressed", "true");
      const mark = document.createElement("i");
      mark.style.background = `var(--${one.colour ?? `curve-${k + 1}`})`;
      if (one.dash) mark.className = "dashed";
      const name = document.createElement("span");
      name.textContent = one.title;
      const value = document.createElement("b");
      button.append(mark, name, value);
      button.onclick = () => {
        const show = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(show));
        this.plot?.setSeries(k + 1, { show });
      };
      if (one.title) head.append(button);
      return value;
    });
    return head;
  }

  fit() {
    const width = Math.floor(this.clientWidth);
    if (width < 60 || !this.data || !this.spec.series.length || !this.shown) return;
    if (this.plot) this.plot.setSize({ width, height: this.spec.height ?? 190 });
    else this.plot = this.make(width);
  }

  make(width) {
    const { spec } = this;
    const lines = (spec.lines ?? []).map((line) => line.value);
    const plot = new uPlot({
      width, height: spec.height ?? 190, legend: { show: false }, padding: [6, 10, 0, 0],
      scales: {
        x: { time: false },
        y: { range: (plot, min, max) => looseRange(plot, Math.min(min, ...lines), Math.max(max, ...lines), lines.length > 2 ? 0.34 : 0.12) },
      },
      axes: [timeAxis(), valueAxis()],
      series: [{}, ...this.shown.map((one, k) => ({
        stroke: () => css(one.colour ?? `curve-${k + 1}`), width: one.width ?? 1.5, dash: one.dash,
        ...(one.points ? { paths: () => null, points: { show: true, size: 4 } } : { points: { show: false } }), spanGaps: true,
      }))],
      cursor: {
        sync: spec.sync ? { key: spec.sync, setSeries: false } : undefined, y: false, points: { size: 6 },
        drag: { x: true, y: false, setScale: false, dist: 6 },
        bind: { dblclick: () => () => { this.zoomAll(...this.whole); return null; } },
      },
      hooks: {
        drawClear: [(plot) => this.drawBands(plot)],
        draw: [(plot) => this.drawLines(plot)],
        setSelect: [(plot) => this.selected(plot)],
        setCursor: [(plot) => this.say(plot.cursor.idx)],
      },
    }, this.data, this.body);
    plot.over.addEventListener("pointerdown", () => { dragged = plot; });
    return plot;
  }

  selected(plot) {
    if (plot.select.width < 6) return;
    if (dragged !== plot) { // the others follow by the time, not by the place
      plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      return;
    }
    const from = plot.posToVal(plot.select.left, "x");
    const to = plot.posToVal(plot.select.left + plot.select.width, "x");
    plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.zoomAll(from, to);
  }

  /** Zoom this chart and those that belong to it; `onZoom` may fetch finer samples. */
  zoomAll(from, to) {
    for (const other of this.sync ? groups.get(this.sync) : [this]) other.plot?.setScale("x", { min: from, max: to });
    this.spec.onZoom?.(from, to, from <= this.whole[0] && to >= this.whole[1]);
  }

  say(place) {
    this.shown.forEach((one, k) => {
      const value = place === null || place === undefined ? null : nearest(this.data[k + 1], place);
      this.values[k].textContent = value === null ? "" : digits(value, 4);
    });
  }

  drawBands(plot) {
    const { ctx, bbox } = plot;
    for (const band of this.spec.bands ?? []) {
      const left = Math.max(bbox.left, plot.valToPos(band.from, "x", true));
      const right = Math.min(bbox.left + bbox.width, plot.valToPos(band.to, "x", true));
      if (right <= left) continue;
      ctx.fillStyle = css("accent-soft");
      ctx.fillRect(left, bbox.top, right - left, bbox.height);
    }
  }

  drawLines(plot) {
    const { ctx, bbox } = plot;
    const named = []; // where a name stands: none over another
    ctx.save();
    for (const line of this.spec.lines ?? []) {
      const y = Math.round(plot.valToPos(line.value, "y", true)) + 0.5;
      if (y < bbox.top || y > bbox.top + bbox.height) continue;
      ctx.strokeStyle = ctx.fillStyle = css(line.colour ?? "poor");
      ctx.setLineDash([6, 4]);
      ctx.lineWidth = devicePixelRatio;
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      if (!line.title) continue;
      ctx.font = `${11 * devicePixelRatio}px sans-serif`;
      ctx.textBaseline = "alphabetic"; // the axes leave another one behind
      ctx.textAlign = line.left ? "left" : "right";
      const upper = y < bbox.top + bbox.height / 2;
      const below = line.left ? !upper : upper; // a limit's name inside its limit, that of the stroke's end outside
      const place = [below, !below].map((under) => y + (under ? 13 : -4) * devicePixelRatio)
        .find((at) => !named.some((one) => one.left === line.left && Math.abs(one.at - at) < 12 * devicePixelRatio));
      if (place === undefined) continue;
      named.push({ left: line.left, at: place });
      ctx.fillText(line.title, line.left ? bbox.left + 4 : bbox.left + bbox.width - 4, place);
    }
    ctx.restore();
  }
}

const scaled = (one) => Array.from(one.value, (value) => (value === null || Number.isNaN(value) ? null : value * (one.factor ?? 1)));

/** Curves over one time: as they are where they share it, else joined. */
function together(series) {
  const first = series[0].time;
  const same = series.every(({ time }) => time === first
    || (time.length === first.length && time[0] === first[0] && time[time.length - 1] === first[first.length - 1]));
  if (same) return [Array.from(first), ...series.map(scaled)];
  return uPlot.join(series.map((one) => [Array.from(one.time), scaled(one)]));
}

/** The value at a place, or the nearest there is. */
function nearest(values, place) {
  for (let k = 0; k < 40; k++) {
    const value = values[place - k] ?? values[place + k];
    if (value !== null && value !== undefined) return value;
  }
  return null;
}

customElements.define("series-chart", SeriesChart);

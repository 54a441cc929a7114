// One panel of the live view: curves over one axis, their names with their values, hidden and shown on a click.
import uPlot from "../vendor/uplot/uPlot.esm.js";
import { colourOf, css } from "./colours.js";
import { steadyRange, timeAxis, valueAxis } from "./axes.js";
import { digits } from "../core/format.js";

const LEAST = { mm: 2, "mm/s": 20, V: 1, bar: 4, kN: 0.5, "%": 2 }; // height of an axis, in the unit shown

// A command may go up and down with every sample, and dashing a path that long takes a tenth of a second: it is thin.
const dashed = (key) => (key.startsWith("reference") ? [5, 4] : undefined);

export class LivePanel {
  /** `spec`: {title, columns, second} — with `second` the last column has an axis of its own, at the right. */
  constructor(spec, owner, { height, last, right }) {
    this.spec = spec;
    this.owner = owner;
    this.height = height;
    this.last = last;
    this.right = right; // room beside the plot, so that panels with a second axis stand in line with those without
    this.muted = owner.muted;
    this.element = document.createElement("section");
    this.element.className = "panel";
    this.element.setAttribute("aria-label", spec.title);
    this.body = document.createElement("div");
    this.body.className = "plot";
    this.element.append(this.head(), this.body);
  }

  head() {
    const head = document.createElement("div");
    head.className = "panel-head";
    const title = document.createElement("h3");
    title.textContent = this.spec.title;
    const unit = document.createElement("span");
    unit.className = "soft small";
    unit.textContent = this.spec.second ? "" : `[${this.spec.columns[0].display.unit}]`;
    head.append(title, unit);
    this.values = this.spec.columns.map((column, k) => this.legend(head, column, k));
    if (this.spec.remove) {
      const close = document.createElement("button");
      close.className = "small quiet";
      close.textContent = "Remove";
      close.onclick = this.spec.remove;
      head.append(close);
    }
    return head;
  }

  legend(head, column, k) {
    const button = document.createElement("button");
    button.className = "legend";
    button.title = `Show or hide ${column.title}`;
    const mark = document.createElement("i");
    mark.style.background = `var(--${this.colour(column, k)})`;
    if (dashed(column.key)) mark.className = "dashed";
    const name = document.createElement("span");
    name.textContent = column.title + (this.spec.second ? ` [${column.display.unit}]` : "");
    const value = document.createElement("b");
    button.append(mark, name, value);
    const show = () => button.setAttribute("aria-pressed", String(!this.muted.has(column.key)));
    button.onclick = () => {
      if (!this.muted.delete(column.key)) this.muted.add(column.key);
      show();
      this.plot?.setSeries(k + 1, { show: !this.muted.has(column.key) });
      this.owner.redraw();
    };
    show();
    head.append(button);
    return value;
  }

  colour(column, k) {
    return this.spec.second ? ["curve-1", "curve-2"][k] : colourOf(column.key, k);
  }

  /** The range of an axis; while the view follows, noise alone does not fill it. */
  range(k) {
    const { display, group } = this.spec.columns[k];
    const least = (LEAST[display.unit] ?? 0) * (group.startsWith("residual") ? 0.1 : 1);
    return steadyRange(() => (this.owner.paused ? 0 : least));
  }

  /** Make the plot once the place it stands in has a width. */
  build(width) {
    const scales = { x: { time: false, auto: false }, y: { auto: true, range: this.range(0) } };
    if (this.spec.second) scales.second = { auto: true, range: this.range(1) };
    const axes = [timeAxis(this.last ? {} : { size: 0, values: () => [] }), valueAxis()];
    if (this.spec.second) axes.push(valueAxis({ scale: "second", side: 1, grid: { show: false } }));
    const last = this.spec.columns.length - 1;
    const series = this.spec.columns.map((column, k) => ({
      scale: this.spec.second && k === last ? "second" : "y",
      stroke: () => css(this.colour(column, k)),
      width: column.key === "command" ? 0.5 : 1, // up to one pixel the browser draws a line several times faster
      dash: dashed(column.key),
      points: { show: false },
      show: !this.muted.has(column.key),
    }));
    const owner = this.owner;
    this.plot = new uPlot({
      width, height: this.height, legend: { show: false }, scales, axes, series: [{}, ...series],
      padding: [6, this.spec.second ? 0 : this.right, this.last ? 0 : 6, 0],
      cursor: {
        sync: { key: owner.sync, setSeries: false }, y: false, points: { size: 6 },
        drag: { x: true, y: false, setScale: false, dist: 6 },
        bind: { dblclick: () => () => { owner.follow(); return null; } },
      },
      hooks: {
        setSelect: [(plot) => {
          if (plot.select.width < 6) return;
          const own = owner.dragged === plot; // the others follow by the time, not by the place
          const from = plot.posToVal(plot.select.left, "x");
          const to = plot.posToVal(plot.select.left + plot.select.width, "x");
          plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          if (own) owner.zoom(from, to);
        }],
        setCursor: [(plot) => owner.pointed(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
        draw: [(plot) => this.drawMarks(plot)],
      },
    }, [[], ...this.spec.columns.map(() => [])], this.body);
    this.plot.over.addEventListener("pointerdown", (event) => {
      owner.dragged = this.plot;
      this.downAt = event.clientX;
    });
    this.plot.over.addEventListener("click", (event) => this.mark(event));
    this.plot.over.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  mark(event) {
    const time = this.plot.posToVal(event.offsetX, "x");
    if (Math.abs(event.clientX - this.downAt) < 5) this.owner.mark(time, event.shiftKey);
  }

  wheel(event) {
    if (!event.ctrlKey && !event.shiftKey && !this.owner.paused) return; // the page scrolls
    event.preventDefault();
    this.owner.zoomAround(this.plot.posToVal(event.offsetX, "x"), event.deltaY > 0 ? 1.25 : 0.8);
  }

  drawMarks(plot) {
    const { ctx, bbox } = plot;
    for (const [name, time] of Object.entries(this.owner.marks)) {
      if (time === null) continue;
      const x = Math.round(plot.valToPos(time, "x", true)) + 0.5;
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = css("ink");
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash([4, 3]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.textAlign = "left"; // the axes leave others behind
      ctx.textBaseline = "alphabetic";
      ctx.font = `bold ${11 * devicePixelRatio}px sans-serif`;
      ctx.fillText(name, x + 4, bbox.top + 11 * devicePixelRatio);
      ctx.restore();
    }
  }

  /** Draw what `ring` has between two times. */
  draw(ring, from, to) {
    if (!this.plot) return;
    const keys = this.spec.columns.map((column) => column.key);
    const data = ring.view(keys, from, to, Math.max(50, this.plot.bbox.width / devicePixelRatio));
    const scaled = this.spec.columns.map((column, k) => scale(data[k + 1], column.display.factor));
    this.plot.batch(() => {
      this.plot.setData([data[0], ...scaled], false);
      this.plot.setScale("x", { min: from, max: to });
    });
  }

  /** Names' values: at the cursor, or the newest. */
  say(ring, time) {
    this.spec.columns.forEach((column, k) => {
      const value = time === null ? ring.last(column.key) : ring.at(column.key, time);
      this.values[k].textContent = digits(value * column.display.factor, 4);
      this.values[k].parentNode.hidden = !this.owner.present.has(column.key);
    });
  }

  resize(width) {
    if (!this.plot) this.build(width);
    else this.plot.setSize({ width, height: this.height });
  }

  destroy() {
    this.plot?.destroy();
  }
}

function scale(values, factor) {
  const result = new Array(values.length);
  for (let i = 0; i < values.length; i++) {
    const value = values[i] * factor;
    result[i] = value === value ? value : null; // NaN is a gap
  }
  return result;
}

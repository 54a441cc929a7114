// The live view: panels over one time that runs along, stands still, or shows a part that was zoomed into.
import { live, onEpoch } from "../core/stream.js";
import { changed } from "../core/store.js";
import { heading, words } from "../core/format.js";
import { LivePanel } from "./live_panel.js";
import { AXIS_PX } from "./axes.js";

const SAID_EVERY_MS = 120;
const HEIGHTS = { position: 190, overlay: 190 };

export class LiveStrips extends HTMLElement {
  constructor() {
    super();
    this.window = 10; // s that are shown while the view follows
    this.sync = "live";
    this.frozen = null; // the samples that are shown while it does not
    this.span = null; // [from, to] that is shown while it does not
    this.muted = new Set();
    this.marks = { A: null, B: null };
    this.groups = null; // names of groups that are shown; null: the ones a newcomer needs
    this.overlays = [];
    this.pointer = null;
    this.panels = [];
    this.present = new Set(); // channels that somebody publishes
  }

  get paused() {
    return this.frozen !== null;
  }

  connectedCallback() {
    this.running = true;
    this.stopListening = onEpoch(() => { this.follow(); this.arrange(); });
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(this);
    this.recolour = () => this.redraw();
    addEventListener("theme", this.recolour);
    this.arrange();
    this.seen = -1;
    requestAnimationFrame((now) => this.tick(now));
  }

  disconnectedCallback() {
    this.running = false;
    this.stopListening();
    this.observer.disconnect();
    removeEventListener("theme", this.recolour);
    this.clear();
  }

  clear() {
    for (const panel of this.panels) panel.destroy();
    this.panels = [];
    this.replaceChildren();
  }

  /** Groups of channels that there are: name → columns, in the server's order. */
  available() {
    const groups = new Map();
    for (const column of live.columns) {
      if (!groups.has(column.group)) groups.set(column.group, []);
      groups.get(column.group).push(column);
    }
    const order = [...groups.keys()];
    const rank = (group) => order.indexOf(group.replace("residual_", "")) + (group.startsWith("residual_") ? 0.5 : 0);
    return new Map([...groups].sort(([a], [b]) => rank(a) - rank(b))); // a residual below what it is the residual of
  }

  /** Whether a group of channels has a panel. */
  shows(group) {
    if (this.groups) return this.groups.has(group);
    if (!this.available().get(group)?.some((column) => this.present.has(column.key))) return false;
    return ["position", "residual_position", "voltage", "pressure"].includes(group);
  }

  toggle(group) {
    this.groups ??= new Set([...this.available().keys()].filter((one) => this.shows(one)));
    if (!this.groups.delete(group)) this.groups.add(group);
    this.arrange();
    changed();
  }

  /** Lay any two channels over each other, each with an axis of its own. */
  overlay(first, second) {
    this.overlays = [...this.overlays.filter((pair) => pair.join() !== [first, second].join()), [first, second]];
    this.arrange();
    changed();
  }

  specs() {
    const specs = this.overlays.map((pair) => {
      const columns = pair.map((key) => live.columns.find((column) => column.key === key)).filter(Boolean);
      const remove = () => {
        this.overlays = this.overlays.filter((other) => other !== pair);
        this.arrange();
        changed();
      };
      return { title: "Overlay", group: "overlay", columns, second: columns.length > 1, remove };
    });
    for (const [group, columns] of this.available()) {
      if (this.shows(group)) specs.push({ title: titleOf(group, columns), group, columns });
    }
    return specs.filter((spec) => spec.columns.length);
  }

  arrange() {
    this.clear();
    const specs = this.specs();
    const right = specs.some((spec) => spec.second) ? AXIS_PX : 20;
    this.panels = specs.map((spec, k) => {
      const last = k === specs.length - 1;
      return new LivePanel(spec, this, { height: (HEIGHTS[spec.group] ?? 132) + (last ? 24 : 0), last, right });
    });
    this.append(...this.panels.map((panel) => panel.element));
    this.fit();
  }

  fit() {
    const width = Math.floor(this.clientWidth);
    if (width < 60 || !this.panels.length) return;
    for (const panel of this.panels) panel.resize(width);
    this.redraw();
  }

  tick(now) {
    if (!this.running) return;
    if (live.samples !== this.seen && !this.paused && this.panels.length) {
      this.seen = live.samples;
      this.redraw();
      live.redraws += 1;
    }
    if (!(now - this.saidAt < SAID_EVERY_MS)) {
      this.saidAt = now;
      this.lookWhatIsThere();
      for (const panel of this.panels) panel.say(this.frozen ?? live.ring, this.pointer);
    }
    requestAnimationFrame((later) => this.tick(later));
  }

  /** Channels come and go with the nodes that publish them: a panel without any is left out. */
  lookWhatIsThere() {
    const ring = this.frozen ?? live.ring;
    const present = live.columns.filter(({ key }) => ring.has(key)).map(({ key }) => key);
    if (present.length === this.present.size && present.every((key) => this.present.has(key))) return;
    this.present = new Set(present);
    const wanted = this.specs().map((spec) => spec.group).join();
    if (wanted !== this.panels.map((panel) => panel.spec.group).join()) this.arrange();
  }

  redraw() {
    const ring = this.frozen ?? live.ring;
    const to = this.span ? this.span[1] : ring.length ? ring.newest : 0;
    const from = this.span ? this.span[0] : to - this.window;
    for (const panel of this.panels) panel.draw(ring, from, to);
  }

  /** Stand still; samples go on arriving and are there when the view follows again. */
  pause() {
    if (this.paused) return;
    this.frozen = live.ring.frozen();
    const to = this.frozen.length ? this.frozen.newest : 0;
    this.span = [to - this.window, to];
    changed();
  }

  /** Show the newest samples as they come. */
  follow() {
    this.frozen = this.span = null;
    this.marks = { A: null, B: null };
    this.seen = -1;
    changed();
  }

  /** Show only what lies between two times. */
  zoom(from, to) {
    this.pause();
    this.span = [from, Math.max(to, from + 0.002)];
    this.redraw();
    changed();
  }

  zoomAround(time, factor) {
    this.pause();
    const [from, to] = this.span;
    this.zoom(time - (time - from) * factor, time + (to - time) * factor);
  }

  /** A shorter or longer window. */
  setWindow(seconds) {
    this.window = seconds;
    if (this.paused) this.follow();
    this.redraw();
    changed();
  }

  /** Set a cursor: A, then B; a third click begins anew. */
  mark(time, second) {
    this.pause();
    const name = second || (this.marks.A !== null && this.marks.B === null) ? "B" : "A";
    if (name === "A") this.marks = { A: time, B: null };
    else this.marks.B = time;
    this.redraw();
    changed();
  }

  pointed(time) {
    this.pointer = time;
  }

  /** What stands at the cursors: rows of {column, a, b}. */
  readings() {
    const ring = this.frozen ?? live.ring;
    const columns = this.panels.flatMap((panel) => panel.spec.columns).filter(({ key }) => this.present.has(key) && !this.muted.has(key));
    return [...new Set(columns)].map((column) => ({
      column,
      a: this.marks.A === null ? NaN : ring.at(column.key, this.marks.A),
      b: this.marks.B === null ? NaN : ring.at(column.key, this.marks.B),
    }));
  }
}

function titleOf(group, columns) {
  return heading(group.startsWith("residual_") ? "residual" : columns.length > 1 ? words(group) : columns[0].title);
}

customElements.define("live-strips", LiveStrips);

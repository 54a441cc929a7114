// The controller: which law, its gains as sliders that act at once, and what it follows.
import { html, nothing } from "../core/html.js";
import { get, post } from "../core/api.js";
import { state, update, changed } from "../core/store.js";
import { attempt, say } from "../core/messages.js";
import { operates, plantRuns } from "../core/actions.js";
import { undoIcon } from "../core/icons.js";
import { digits, words } from "../core/format.js";

const chosen = { gains: null, kind: null, values: {} };
let asked = "";
const pending = new Map();
const firsts = new Map(); // what a gain was when it was first seen: its slider stays where it is
let timer = null;
let asks = 0; // of the controller; an answer that a later question has overtaken is old

async function load() {
  if (!state.controllers && !state.asksForControllers) {
    state.asksForControllers = true;
    const controllers = await attempt(() => get("/api/controllers"));
    if (controllers) update({ controllers });
    else setTimeout(() => update({ asksForControllers: false }), 3000);
  }
  const { phase, law } = state.bench.controller ?? {};
  if (phase === "running" && asked !== law) {
    asked = law;
    firsts.clear();
    const gains = await attempt(() => get("/api/controller/gains"));
    if (gains) update({ gains });
  }
  if (phase !== "running") asked = "";
}

/** Send what the sliders say, at most ten times a second. */
function set(parameter, value) {
  pending.set(parameter.name, value);
  parameter.value = value;
  changed();
  timer ??= setTimeout(async () => {
    timer = null;
    const values = Object.fromEntries(pending);
    pending.clear();
    await ask("/api/controller/gains", { values });
  }, 100);
}

async function ask(path, body) {
  const mine = ++asks;
  const answer = await attempt(() => post(path, body));
  if (!answer || mine !== asks) return;
  if (!answer.ok) say(answer.message || "The controller refused.", "poor");
  if (!pending.size && answer.parameters) update({ gains: { ...state.gains, parameters: answer.parameters } });
}

const undo = () => ask("/api/controller/undo");

/** Bounds of a slider: the parameter's own, else around its first value. */
function bounds(parameter) {
  if (!firsts.has(parameter.name)) firsts.set(parameter.name, parameter.value);
  const first = firsts.get(parameter.name);
  const size = Math.abs(first) || 1;
  let low = parameter.minimum ?? (first < 0 ? -4 * size : 0);
  let high = parameter.maximum ?? 4 * size;
  if (high - low > 40 * size) [low, high] = [Math.max(low, -4 * size), Math.min(high, Math.max(4 * size, low + 4 * size))];
  return [Math.min(low, parameter.value), Math.max(high, parameter.value)];
}

function field(parameter, change) {
  const { factor = 1, unit = parameter.unit ?? "" } = parameter.display || {};
  if (parameter.choices) {
    return html`<label class="field" title=${parameter.description ?? ""}>${words(parameter.name)}
      <select ?disabled=${!operates()} @change=${(event) => change(parameter, event.target.value)}>
        ${parameter.choices.map((choice) => html`<option ?selected=${choice === parameter.value}>${choice}</option>`)}</select></label>`;
  }
  if (typeof parameter.value === "boolean") {
    return html`<label class="check" title=${parameter.description ?? ""}><input type="checkbox" .checked=${parameter.value} ?disabled=${!operates()}
      @change=${(event) => change(parameter, event.target.checked)}> ${words(parameter.name)}</label>`;
  }
  if (typeof parameter.value !== "number") return nothing;
  const [low, high] = bounds(parameter);
  const outside = parameter.minimum !== null && parameter.minimum !== undefined && parameter.maximum !== null && parameter.maximum !== undefined
    ? `${digits(parameter.minimum * factor, 3)} … ${digits(parameter.maximum * factor, 3)} ${unit}` : "";
  return html`<label class="field slider" title=${[parameter.description, outside].filter(Boolean).join(" · ")}>
    <span class="row spread"><span>${words(parameter.name)}</span><b>${parameter.whole ? parameter.value : digits(parameter.value * factor, 4)} ${unit}</b></span>
    <input type="range" min=${low} max=${high} step=${parameter.whole ? 1 : (high - low) / 200} .value=${String(parameter.value)} ?disabled=${!operates()}
      @input=${(event) => change(parameter, Number(event.target.value))}></label>`;
}

function law() {
  const now = state.bench.controller ?? { phase: "off" };
  const laws = state.controllers?.laws ?? [];
  chosen.gains ??= laws.find((one) => one.name === "npid")?.gains ?? laws[0]?.gains;
  if (now.phase === "off" || now.phase === "failed") {
    return html`${now.text && now.phase === "failed" ? html`<p class="notice poor">${now.text}</p>` : nothing}
      <label class="field">Law <select @change=${(event) => { chosen.gains = event.target.value; changed(); }}>
        ${laws.map((one) => html`<option value=${one.gains} ?selected=${one.gains === chosen.gains} title=${one.summary}>${one.title}</option>`)}</select></label>
      <button id="start-controller" ?disabled=${!operates() || !plantRuns() || !chosen.gains}
        @click=${() => attempt(() => post("/api/controller/start", { gains: chosen.gains }))}>Start the controller</button>`;
  }
  if (now.phase === "starting") return html`<p class="soft"><i class="spinner"></i> starting ${now.law}</p>`;
  const parameters = (state.gains?.parameters ?? []).filter((one) => one.live);
  return html`<div class="row spread"><strong>${words(now.law)}</strong>
      <span class="row"><button class="small" id="undo-gains" ?disabled=${!operates() || !now.can_undo} @click=${undo}>${undoIcon()}Undo</button>
      <button class="small" id="stop-controller" ?disabled=${!operates()} @click=${() => attempt(() => post("/api/controller/stop"))}>Stop</button></span></div>
    <div class="stack tight gains">${parameters.map((one) => field(one, set))}</div>`;
}

function reference() {
  const now = state.bench.reference ?? { phase: "off" };
  const kinds = state.controllers?.references ?? [];
  if (now.phase === "running") {
    return html`<div class="row spread"><span>Follows a <strong>${words(now.kind)}</strong></span>
      <button class="small" ?disabled=${!operates()} @click=${() => attempt(() => post("/api/reference/stop"))}>Stop</button></div>
      ${now.text ? html`<p class="soft small">${now.text}</p>` : nothing}`;
  }
  const kind = kinds.find((one) => one.kind === chosen.kind) ?? kinds.find((one) => one.kind === "sine") ?? kinds[0];
  if (!kind) return nothing;
  const change = (parameter, value) => { parameter.value = value; chosen.values[parameter.name] = value; changed(); };
  return html`<label class="field">Reference <select @change=${(event) => { chosen.kind = event.target.value; chosen.values = {}; changed(); }}>
      ${kinds.map((one) => html`<option value=${one.kind} ?selected=${one === kind}>${one.title}</option>`)}</select></label>
    <details><summary>Its shape</summary><div class="stack tight">${kind.parameters.map((one) => field(one, change))}</div></details>
    <button id="start-reference" ?disabled=${!operates()}
      @click=${() => attempt(() => post("/api/reference/start", { kind: kind.kind, values: chosen.values }))}>Follow it</button>`;
}

export function control() {
  load();
  if (!state.controllers) return nothing;
  const running = state.bench.controller?.phase === "running";
  return html`<section class="card" aria-label="Controller"><header><h2>Controller</h2>
      ${running ? html`<span class="chip good"><i class="dot"></i>running</span>` : nothing}</header>
    <div class="stack tight">${law()}</div>
    ${running ? html`<hr><div class="stack tight">${reference()}</div>` : nothing}
  </section>`;
}

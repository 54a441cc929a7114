// The live view: curves, cursors, health, the model beside the plant, the controller.
import { html, nothing, ref } from "../core/html.js";
import { state, changed } from "../core/store.js";
import { post } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { live } from "../core/stream.js";
import { operates, plantRuns, open } from "../core/actions.js";
import { digits, words } from "../core/format.js";
import { displayOf } from "../core/quantities.js";
import { pauseIcon, playIcon } from "../core/icons.js";
import "../charts/live_strips.js";
import { health } from "./health.js";
import { control } from "./control.js";

const WINDOWS = [2, 5, 10, 30, 60];
let strips = null;
const pair = [null, null];

const bind = (element) => { strips = element ?? null; };

function toolbar() {
  const paused = strips?.paused ?? false;
  const groups = strips ? [...strips.available().keys()] : [];
  return html`<div class="row toolbar" role="toolbar" aria-label="Live plots">
    <button id="pause" aria-pressed=${paused} title="Pause or follow (P)" @click=${() => (paused ? strips.follow() : strips?.pause())}>
      ${paused ? playIcon() : pauseIcon()}${paused ? "Follow" : "Pause"}</button>
    <div class="segmented" role="group" aria-label="Window">
      ${WINDOWS.map((seconds) => html`<button aria-pressed=${strips?.window === seconds && !paused}
        @click=${() => strips?.setWindow(seconds)}>${seconds} s</button>`)}
    </div>
    <details class="menu"><summary class="button">Panels</summary>
      <div class="card popup stack tight">${groups.map((group) => html`<label class="check">
        <input type="checkbox" .checked=${strips.shows(group)} @change=${() => strips.toggle(group)}> ${words(group)}</label>`)}</div>
    </details>
    <details class="menu"><summary class="button">Overlay</summary>${overlayMenu()}</details>
    <span class="soft small push hint">drag to zoom · click for cursors A, B · double click to follow</span>
  </div>`;
}

function overlayMenu() {
  const options = (k) => html`<select aria-label=${k ? "with" : "Overlay"} @change=${(event) => { pair[k] = event.target.value; changed(); }}>
    ${live.columns.map((one) => html`<option value=${one.key} ?selected=${one.key === pair[k]}>${one.title}</option>`)}</select>`;
  pair[0] ??= live.columns[0]?.key;
  pair[1] ??= live.columns[3]?.key;
  return html`<div class="card popup stack tight">
    <span class="soft small">Any two channels in one panel, each with its own axis.</span>
    ${options(0)}${options(1)}
    <button class="small" ?disabled=${!pair[0] || !pair[1] || pair[0] === pair[1]} @click=${(event) => {
      event.target.closest("details").open = false;
      strips?.overlay(...pair);
    }}>Overlay</button></div>`;
}

function cursors() {
  if (!strips || strips.marks.A === null) return nothing;
  const { A, B } = strips.marks;
  return html`<section class="card"><header><h2>Cursors</h2>
      <button class="small quiet" @click=${() => strips.follow()}>Clear</button></header>
    <div class="scroll"><table class="cursors"><thead><tr><th>Channel</th><th class="number">A</th><th class="number">B</th><th class="number">B − A</th></tr></thead>
      <tbody><tr><th>time [s]</th><td class="number">${digits(A, 5)}</td><td class="number">${B === null ? "–" : digits(B, 5)}</td>
        <td class="number">${B === null ? "–" : digits(B - A, 4)}</td></tr>
      ${strips.readings().map(({ column: one, a, b }) => html`<tr><th>${one.title} <span class="soft">${one.display.unit}</span></th>
        <td class="number">${digits(a * one.display.factor)}</td><td class="number">${digits(b * one.display.factor)}</td>
        <td class="number">${digits((b - a) * one.display.factor)}</td></tr>`)}</tbody></table></div>
  </section>`;
}

const chooseModel = (event) => attempt(() => post("/api/live_model", { model: event.target.value || null }));

/** The model that runs beside the plant, and how far they are apart now. */
function liveModel() {
  const now = state.bench.live_model ?? { phase: "off" };
  const display = displayOf("m");
  return html`<section class="card"><header><h2>Model beside the plant</h2>
      ${now.phase === "running" ? html`<span class="chip good"><i class="dot"></i>running</span>` : nothing}
      ${now.phase === "starting" ? html`<span class="chip accent"><i class="spinner"></i>starting</span>` : nothing}</header>
    <label class="field">Model
      <select id="live-model" ?disabled=${!operates()} @change=${chooseModel}>
        <option value="" ?selected=${!now.model}>none</option>
        ${state.models.map((model) => html`<option value=${model.id} ?selected=${model.id === now.model}>${model.name}</option>`)}
      </select></label>
    ${now.phase === "running"
      ? html`<p class="residual"><b>${Number.isFinite(now.residual) ? digits(now.residual * display.factor, 3) : "–"}</b> ${display.unit}
          <span class="soft">residual of the position, root mean square of the last 2 s</span></p>`
      : html`<p class="soft small" style="margin-top:8px">It runs on the applied drive; the residual is measured − predicted.</p>`}
    ${now.text ? html`<p class="soft small">${now.text}</p>` : nothing}
  </section>`;
}

export function liveView() {
  const empty = !plantRuns() && !live.ring.length;
  return html`
    <div class="title"><div><h1>Live</h1></div></div>
    <div class="columns">
      <section class="card live-card" aria-label="Live plots">
        ${toolbar()}
        ${empty ? html`<div class="empty"><p>No plant runs.</p><button class="primary" @click=${() => open("plant")}>Choose one</button></div>` : nothing}
        <live-strips ?hidden=${empty} ${ref(bind)}></live-strips>
      </section>
      <div class="stack">${cursors()}${health()}${liveModel()}${control()}</div>
    </div>`;
}

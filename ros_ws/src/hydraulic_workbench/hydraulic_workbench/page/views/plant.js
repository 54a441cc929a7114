// Which plant: a simulator, one with a hidden effect to find, a virtual CAN bench, or the real one.
import { html, nothing, live } from "../core/html.js";
import { get, post } from "../core/api.js";
import { state, update, changed } from "../core/store.js";
import { ask } from "../core/dialogs.js";
import { attempt } from "../core/messages.js";
import { modelOf, open, operates, plant, plantRuns } from "../core/actions.js";
import { words } from "../core/format.js";
import { faults, guess } from "./plant_running.js";
import { hiddenEffects } from "./hidden_effects.js";

const chosen = { model: null, hidden: {}, bus: null, canModel: null, realBus: null, channel: null, lockstep: true };

async function load() {
  if (state.choices || state.asksForChoices) return;
  state.asksForChoices = true;
  const choices = await attempt(() => get("/api/plants"));
  if (choices) update({ choices });
  else setTimeout(() => update({ asksForChoices: false }), 3000);
}

async function start(request) {
  if (plantRuns()) {
    const agreed = await ask({
      title: "Replace the plant?",
      body: html`<p>${plant().name} is stopped first. Its drive goes to 0 V.</p>`,
      yes: "Replace it",
    });
    if (!agreed) return;
  }
  const answer = await attempt(() => post("/api/plant/start", request));
  if (answer) open("live");
}

async function startReal(bus) {
  const agreed = await ask({
    title: "Connect to hardware?",
    body: html`<p>The driver starts on bus ${bus.name} (${bus.interface}, ${bus.channel}). It stays disabled until you enable it.</p>
      <ul><li>The emergency stop of the bench works and is within reach.</li><li>Nobody is near the moving parts.</li>
      <li>The checklist of the first power-on has been passed.</li></ul>
      <p class="soft">This page is no safety device.</p>`,
    yes: "Connect",
  });
  if (agreed) start({ kind: "can", bus: bus.name, interface: bus.interface, channel: bus.channel });
}

/** The current model where a plant can be made of it. */
const usual = (models) => (models.find((model) => model.id === state.bench.current_model?.id) ?? models[0])?.id;

const stopPlant = () => attempt(() => post("/api/plant/stop"));

function modelField(models, value, pick) {
  return html`<label class="field">Model
    <select @change=${(event) => pick(event.target.value)}>
      ${models.map((model) => html`<option value=${model.id} ?selected=${model.id === value}>${model.name}</option>`)}
    </select></label>`;
}

function guessCard(first) {
  return html`<section class="card choice ${first ? "first" : ""}">
    <h2>Guess what is wrong</h2>
    <p>A simulator that hides one effect its model file does not have. Find it with the tools of this page. A good first round.</p>
    <ol class="loop small"><li>Start it and enable it.</li><li>Run the experiment <em>first_look</em>.</li>
      <li>Diagnose the record, add what is missing.</li><li>Answer what was hidden.</li></ol>
    <button class=${first ? "primary" : ""} id="start-guess" ?disabled=${!operates()} @click=${() => start({ kind: "guess" })}>Start with a hidden effect</button>
  </section>`;
}

function simulatorCard(choices) {
  const { models, effects } = choices.simulator;
  chosen.model ??= usual(models);
  const count = Object.keys(chosen.hidden).length;
  return html`<section class="card choice">
    <h2>Simulator</h2>
    <p>Any model file as the plant. Hide effects in it to teach, or to see what a diagnosis makes of them.</p>
    ${modelField(models, chosen.model, (id) => { chosen.model = id; changed(); })}
    <details ?open=${count > 0}><summary>Hidden effects${count ? ` (${count})` : ""}</summary>${hiddenEffects(effects, chosen.hidden)}</details>
    <label class="check"><input type="checkbox" .checked=${live(chosen.lockstep)}
      @change=${(event) => { chosen.lockstep = event.target.checked; changed(); }}> Lockstep: a busy machine stretches time instead of losing samples</label>
    <button id="start-simulator" ?disabled=${!operates() || !chosen.model}
      @click=${() => start({ kind: "simulator", model: chosen.model, hidden: chosen.hidden, lockstep: chosen.lockstep })}>Start the simulator</button>
  </section>`;
}

function virtualCard({ buses: all, models }) {
  const buses = all.map((bus) => bus.name ?? bus);
  chosen.bus ??= buses[0];
  chosen.canModel ??= usual(models);
  return html`<section class="card choice">
    <h2>Virtual CAN bench</h2>
    <p>The driver of the real bench against simulated devices on a CAN bus, with faults on buttons.</p>
    <label class="field">Bus file <select @change=${(event) => { chosen.bus = event.target.value; changed(); }}>
      ${buses.map((bus) => html`<option ?selected=${bus === chosen.bus}>${bus}</option>`)}</select></label>
    ${modelField(models, chosen.canModel, (id) => { chosen.canModel = id; changed(); })}
    <button id="start-virtual" ?disabled=${!operates() || !chosen.bus}
      @click=${() => start({ kind: "can_virtual", bus: chosen.bus, model: chosen.canModel })}>Start the virtual bench</button>
  </section>`;
}

function realCard({ buses }) {
  const bus = buses.find((one) => one.name === chosen.realBus) ?? buses[0];
  const channel = chosen.channel ?? bus?.channel ?? "";
  return html`<section class="card choice">
    <h2>Real bench</h2>
    <p>The CAN driver on an interface of this machine. It starts disabled, after a question.</p>
    ${buses.length
      ? html`<label class="field">Bus file <select id="real-bus" @change=${(event) => { Object.assign(chosen, { realBus: event.target.value, channel: null }); changed(); }}>
          ${buses.map((one) => html`<option value=${one.name} ?selected=${one === bus}>${one.name}</option>`)}
        </select></label>
        <label class="field">Channel of ${bus.interface} <input type="text" id="real-channel" spellcheck="false" .value=${live(channel)}
          @input=${(event) => { chosen.channel = event.target.value; changed(); }}></label>`
      : html`<p class="soft">There is no bus file of a real bench.</p>`}
    <button id="start-real" ?disabled=${!operates() || !bus || !channel.trim()} @click=${() => startReal({ ...bus, channel: channel.trim() })}>Connect…</button>
  </section>`;
}

function runningCard() {
  const now = plant();
  return html`<section class="card running">
    <header><h2>${now.name}</h2><span class="chip">${words(now.kind)}</span>
      <button id="stop-plant" ?disabled=${!operates()} @click=${stopPlant}>Shut down</button></header>
    <p>${now.text}</p>
    <dl class="facts">
      <dt>Model file</dt><dd>${modelOf(now.model)?.name ?? "–"}</dd>
      <dt>Commanded by</dt><dd>${now.source || "nobody"}</dd>
    </dl>
    ${guess()}
    ${faults()}
  </section>`;
}

export function plantView() {
  load();
  const { choices } = state;
  const on = plant().kind !== "none" && plant().phase !== "stopped";
  return html`
    <div class="title"><div><h1>Plant</h1>
      <p>Everything on this page works alike on a simulated and on a real actuator. Nothing moves until you enable it.</p></div></div>
    <div class="stack">
      ${on ? runningCard() : nothing}
      ${on ? html`<h2>Another one</h2>` : nothing}
      ${choices
        ? html`<div class="cards">${guessCard(!on)}${simulatorCard(choices)}${virtualCard(choices.can_virtual)}${realCard(choices.can)}</div>`
        : html`<div class="empty"><i class="spinner"></i></div>`}
    </div>`;
}

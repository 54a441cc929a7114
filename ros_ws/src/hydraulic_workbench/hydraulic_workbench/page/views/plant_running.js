// What a running plant offers beside its topics: faults of a virtual bench, the answer to a hidden effect.
import { html, nothing } from "../core/html.js";
import { post } from "../core/api.js";
import { state, changed } from "../core/store.js";
import { attempt, say } from "../core/messages.js";
import { operates, plant } from "../core/actions.js";
import { words } from "../core/format.js";

const provoke = (fault) => attempt(() => post("/api/plant/fault", { fault: fault.name, node: fault.node, on: !fault.on }));

/** Buttons that break something on the virtual bus. */
export function faults() {
  const all = plant().faults ?? [];
  if (!all.length) return nothing;
  const nodes = [...new Set(all.map((fault) => fault.node))];
  return html`<h3 style="margin-top:16px">Faults to provoke</h3>
    <p class="soft small">Each device fails as its real counterpart would. Live shows how the driver reacts.</p>
    ${nodes.map((node) => html`<div class="device" role="group" aria-label=${`Faults of ${node}`}>
      <span class="soft small">${words(node)}</span><span class="row">
      ${all.filter((fault) => fault.node === node).map((fault) => html`
        <button class="small fault" aria-pressed=${fault.on} title=${fault.title} ?disabled=${!operates()} @click=${() => provoke(fault)}>
          ${words(fault.name)}</button>`)}
    </span></div>`)}`;
}

let answer = "";

/** Say what the simulator hides. */
export async function answerGuess(effect) {
  const result = await attempt(() => post("/api/guess/answer", { effect }));
  if (result) say(result.text, result.right ? "good" : "info");
}

/** Say which effect the simulator hides. */
export function guess() {
  const now = state.bench.guess;
  if (!now || !state.choices) return nothing;
  const effects = state.choices.simulator.effects;
  if (now.phase === "revealed" || now.right) {
    return html`<p class="notice ${now.right ? "good" : "accent"}" style="margin-top:12px">${now.right ? "Right: it hides " : "It hides "}
      <strong>${words(now.effect)}</strong>. ${now.text}</p>`;
  }
  return html`<div class="stack tight" style="margin-top:14px">
    <h3>What does it hide?</h3>
    ${now.text ? html`<p class="soft">${now.text}</p>` : nothing}
    <div class="row">
      <select aria-label="Effect" @change=${(event) => { answer = event.target.value; changed(); }}>
        <option value="">Choose an effect …</option>
        ${effects.map((effect) => html`<option value=${effect.name} ?selected=${effect.name === answer}>${effect.title || words(effect.name)}</option>`)}
      </select>
      <button ?disabled=${!answer || !operates()} @click=${() => answerGuess(answer)}>Answer</button>
      <button class="quiet" ?disabled=${!operates()} @click=${() => attempt(() => post("/api/guess/reveal"))}>Tell me</button>
    </div></div>`;
}

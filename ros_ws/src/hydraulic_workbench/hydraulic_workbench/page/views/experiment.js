// An experiment: choose or design it, rehearse it on the model, pass the gate, run it, keep the record.
import { html, nothing } from "../core/html.js";
import { state, update } from "../core/store.js";
import { operates, plant, plantRuns, recordOf, runs, jobOf, enable, open } from "../core/actions.js";
import { post } from "../core/api.js";
import { attempt } from "../core/messages.js";
import { digits, duration, heading, percent, words } from "../core/format.js";
import { checkIcon, crossIcon, lockIcon, warnIcon } from "../core/icons.js";
import { choose, chosenPlan, rehearsal, rehearse } from "./rehearsals.js";
import { rehearsalCharts } from "./rehearsal_charts.js";
import { designForm } from "./design.js";
import { diagnoseRecord } from "./diagnosis_steps.js";

const BUSY = ["starting", "recording", "running"];
const SOURCES = { next_experiment: "proposed by a diagnosis", designed: "designed here", opened: "opened", shipped: "" };

function planRow(plan) {
  const now = chosenPlan();
  return html`<label class="plan ${now?.id === plan.id ? "chosen" : ""}">
    <input type="radio" name="plan" .checked=${now?.id === plan.id} @change=${() => choose(plan.id)}>
    <span class="grow"><strong>${plan.name}</strong>
      ${plan.recommended ? html`<span class="chip good">a good first one</span>` : nothing}
      ${SOURCES[plan.source] ? html`<span class="chip accent">${SOURCES[plan.source]}</span>` : nothing}
      <br><span class="soft small">${plan.description || words(plan.signal)}</span></span>
    <span class="soft small facts">${duration(plan.seconds)}<br>${plan.amplitude ? `${digits(plan.amplitude, 2)} V` : ""}</span>
  </label>`;
}

function check(good, title, text, level = good ? "ok" : "stop", used = null, action = nothing) {
  const tone = { ok: "good", warn: "fair", stop: "poor", wait: "soft" }[level];
  const icon = level === "wait" ? html`<i class="spinner"></i>` : level === "ok" ? checkIcon() : level === "warn" ? warnIcon() : crossIcon();
  return html`<li class="gate-${tone}"><span class="mark">${icon}</span>
    <span class="grow"><strong>${title}</strong> <span class="soft">${text}</span>
      ${used !== null && Number.isFinite(used) ? html`<span class="used" title=${`${percent(used)} of the limit`}>
        <span style=${`width:${Math.min(100, 100 * used)}%`} class=${used > 1 ? "over" : ""}></span></span>` : nothing}</span>
    ${action}</li>`;
}

/** What must hold before Start; the server asks the same again. */
function gate(now) {
  const doc = now?.doc;
  const { enabled, stopped, source } = plant();
  const items = [];
  if (!now || runs(jobOf(now.job))) items.push(check(false, "Rehearsal", "runs on the model …", "wait"));
  else if (now.error) items.push(check(false, "Rehearsal", now.error, "stop", null, html`<button class="small" @click=${() => rehearse(chosenPlan(), true)}>Again</button>`));
  for (const one of doc?.checks ?? []) items.push(check(one.good, heading(one.title), one.text, one.level, one.name === "identifiability" ? null : one.used));
  items.push(check(plantRuns() && !stopped, "Plant", plantRuns() ? (stopped ? "stopped: reset it first" : "runs") : "none runs", undefined, null,
    plantRuns() ? nothing : html`<button class="small" @click=${() => open("plant")}>Choose one</button>`));
  if (plantRuns() && !stopped) {
    items.push(check(enabled, "Enabled", enabled ? "commands move the actuator" : "commands are refused", undefined, null,
      enabled ? nothing : html`<button class="small" ?disabled=${!operates()} @click=${enable}>Enable…</button>`));
    const busy = source && !BUSY.includes(state.bench.experiment?.phase);
    if (busy) items.push(check(false, "Nobody else commands", `${source} does`));
  }
  const passes = Boolean(doc?.verdict?.go) && plantRuns() && enabled && !stopped && !source;
  return { items, passes };
}

function identifiability(doc) {
  const all = doc?.identifiability ?? [];
  if (!all.length) return nothing;
  const lost = all.filter((one) => !one.identifiable);
  return html`<details class="small"><summary>Identifies ${all.length - lost.length} of ${all.length} parameters</summary>
    <div class="scroll"><table><thead><tr><th>Parameter</th><th class="number">Standard error</th><th></th></tr></thead><tbody>
      ${all.map((one) => html`<tr><th>${one.title || words(one.key)}</th>
        <td class="number">${one.standard_error_relative === null ? "–" : percent(one.standard_error_relative)}</td>
        <td>${one.identifiable ? html`<span class="chip good">identifiable</span>` : html`<span class="chip fair">not identifiable</span>`}</td></tr>`)}
    </tbody></table></div></details>`;
}

async function start(plan, now) {
  await attempt(() => post("/api/experiments/start", { plan: plan.id, rehearsal: now.run }));
}

const abort = () => attempt(() => post("/api/experiments/abort"));

function progress() {
  const now = state.bench.experiment ?? { phase: "idle" };
  if (now.phase === "idle") return nothing;
  const record = recordOf(now.record);
  if (BUSY.includes(now.phase)) {
    return html`<section class="card" aria-label="Progress" aria-live="polite"><header><h2>${now.plan_name}</h2><span class="chip accent">${now.phase}</span>
        <button class="danger" id="abort" ?disabled=${!operates()} @click=${abort}>Abort</button></header>
      <progress max="1" value=${now.progress ?? 0} aria-label="Progress of the experiment"></progress>
      <p class="row spread" style="margin-top:8px"><span>${now.text}</span>
        <span class="soft">${now.seconds_left ? `${duration(now.seconds_left)} left` : ""}</span></p>
      <p class="row"><a href="#/live">Watch it live</a></p></section>`;
  }
  const good = now.phase === "finished";
  return html`<section class="card" aria-label="Result"><header><h2>${now.plan_name}</h2>
      <span class="chip ${good ? "good" : "poor"}">${now.phase}</span></header>
    <p>${now.text}</p>
    ${record ? html`<p class="row" style="margin-top:10px">
      <button class=${good ? "primary" : ""} ?disabled=${!operates()} @click=${() => diagnoseRecord(record)}>Diagnose ${record.name}</button>
      <button @click=${() => { update({ shownRecords: [record.id] }); open("records"); }}>Look at it</button></p>` : nothing}
  </section>`;
}

function gateCard(plan) {
  const now = rehearsal(plan);
  const { items, passes } = gate(now);
  const busy = BUSY.includes(state.bench.experiment?.phase);
  return html`<section class="card" aria-label="Gate"><header><h2>Before it starts</h2>
      ${now?.doc ? html`<span class="chip ${now.doc.verdict.go ? "good" : "poor"}">${now.doc.verdict.go ? "rehearsal passed" : "rehearsal failed"}</span>` : nothing}</header>
    <ul class="gate">${items}</ul>
    ${identifiability(now?.doc)}
    <div class="row" style="margin-top:12px">
      <button class="primary" id="start-experiment" ?disabled=${!operates() || !passes || busy} @click=${() => start(plan, now)}>
        ${passes ? nothing : lockIcon()}Start ${plan.name}</button>
      <button class="quiet" ?disabled=${!operates() || busy} @click=${() => rehearse(plan, true)}>Rehearse again</button>
      ${now?.doc && !now.doc.verdict.go ? html`<span class="soft small">${now.doc.verdict.text}</span>` : nothing}
    </div></section>`;
}

export function experimentView() {
  const plan = chosenPlan();
  if (plan) rehearse(plan);
  const [first, rest] = split(state.plans);
  return html`
    <div class="title"><div><h1>Experiment</h1>
      <p>A drive for the valve. It is rehearsed on the model before anything moves; Start stays locked until every check passes.</p></div></div>
    <div class="columns left">
      <div class="stack">
        <section class="card"><header><h2>Choose</h2></header>
          <div class="plans" role="radiogroup" aria-label="Plans">${first.map(planRow)}
            ${rest.length ? html`<details ?open=${rest.some((one) => one.id === plan?.id)}><summary>${rest.length} more</summary>${rest.map(planRow)}</details>` : nothing}</div>
        </section>
        ${designForm()}
      </div>
      <div class="stack">
        ${progress()}
        ${plan ? html`${gateCard(plan)}${rehearsalCharts(rehearsal(plan)?.doc)}` : html`<div class="empty"><p>No plan is chosen.</p></div>`}
      </div>
    </div>`;
}

/** The few that are shown at once: the user's own, then the recommended; the others on a click. */
function split(plans) {
  const own = plans.filter((plan) => plan.source !== "shipped");
  const shipped = plans.filter((plan) => plan.source === "shipped").sort((a, b) => Boolean(b.recommended) - Boolean(a.recommended));
  const all = [...own, ...shipped];
  const count = Math.max(4, own.length);
  return [all.slice(0, count), all.slice(count)];
}


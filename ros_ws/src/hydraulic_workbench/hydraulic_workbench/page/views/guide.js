// One line that says what a newcomer does next, with the button for it.
import { html, nothing } from "../core/html.js";
import { state, update } from "../core/store.js";
import { enable, open, operates, plant, plantRuns, runs } from "../core/actions.js";
import { words } from "../core/format.js";
import { currentTab } from "./tabs.js";
import { answerGuess } from "./plant_running.js";
import { besidePlant } from "./timeline.js";
import { addEffect, bestAddable, diagnoseRecord, lastDiagnosis } from "./diagnosis_steps.js";

/** What is next: {text, does, run}; null where nothing is to be said. */
function next() {
  if (!state.online || !state.loaded) return null;
  const now = plant();
  const experiment = state.bench.experiment || { phase: "idle" };
  const busy = state.jobs.find((job) => runs(job) && ["diagnose", "add", "calibrate"].includes(job.verb));
  if (busy) return currentTab() === "diagnose" ? null : step(`${words(busy.verb)} is running.`, "Watch", () => open("diagnose"));
  const found = afterDiagnosis() ?? afterAdding();
  if (found) return found;
  if (now.stopped && plantRuns()) return null; // the banner of the stop says it
  if (!plantRuns()) return state.records.length ? null : noPlant();
  if (["starting", "recording", "running"].includes(experiment.phase)) {
    return currentTab() === "experiment" ? null : step("The experiment is running.", "Watch", () => open("live"));
  }
  const record = state.records.find((one) => one.id === experiment.record);
  if (experiment.phase === "finished" && record && !state.jobs.some((job) => job.records?.includes(record.id))) {
    return step(`Record ${record.name} is there. What does the model lack?`, "Diagnose this record", () => diagnoseRecord(record));
  }
  if (!now.enabled) return step("The plant runs and is disabled: nothing moves.", "Enable…", enable);
  if (currentTab() !== "experiment") return step("The plant is enabled.", "Choose an experiment", () => open("experiment"));
  return null;
}

const noPlant = () => (currentTab() === "plant" ? null : step("No plant runs.", "Choose one", () => open("plant")));

/** A diagnosis that named something: add it. */
function afterDiagnosis() {
  const job = lastDiagnosis();
  const best = bestAddable(job);
  if (!best) return null;
  return step(`The diagnosis names ${words(best)}.`, `Add ${words(best)}`, () => addEffect(job, best));
}

/** An effect was added and only noise is left: say so where a guess is open, then look at it live. */
function afterAdding() {
  const current = state.timeline.steps.find((one) => one.current);
  if (current?.what !== "added" || !(current.error_after < 1.1)) return null;
  const left = `With ${words(current.effect)} the error is at the noise.`;
  if (state.bench.guess?.phase === "hidden" || state.bench.guess?.phase === "guessed") {
    if (!state.bench.guess.right) return step(left, `Answer: ${words(current.effect)}`, () => answerGuess(current.effect));
  }
  if (!plantRuns() || state.bench.live_model?.model === current.model) return null;
  return step(`${left} Watch it follow the plant.`, "Run it beside the plant", () => besidePlant(current.model));
}

const step = (text, does, run) => ({ text, does, run });

export function guide() {
  if (state.guideOff) return nothing;
  const now = next();
  if (!now) return nothing;
  return html`<div class="guide" role="region" aria-label="Next step">
    <span class="chip accent">Next</span><span class="grow">${now.text}</span>
    <button class="primary" id="next" ?disabled=${!operates()} @click=${now.run}>${now.does}</button>
    <button class="quiet icon" aria-label="Hide the next step" title="Hide the next step" @click=${() => update({ guideOff: true })}>×</button>
  </div>`;
}

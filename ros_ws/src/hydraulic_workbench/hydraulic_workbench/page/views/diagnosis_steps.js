// The steps from a record to a better model, as they are called from several tabs.
import { state, changed, update } from "../core/store.js";
import { get, post } from "../core/api.js";
import { ended, open, recordOf, runs, startJob } from "../core/actions.js";
import { attempt, say } from "../core/messages.js";
import { refresh } from "../core/connection.js";
import { words } from "../core/format.js";

Object.assign(state, { chosenRecords: null, shownJob: null, quick: false });
const documents = new Map(); // run → document, or null while it is fetched

/** Records that a verb is given: what the user ticked, else the newest. */
export function chosenRecords() {
  const readable = state.records.filter((record) => !record.problem);
  const ticked = (state.chosenRecords ?? []).map(recordOf).filter(Boolean);
  if (state.chosenRecords) return ticked;
  return [...readable].sort((a, b) => b.created - a.created).slice(0, 1);
}

/** The document of a run; fetched once. */
export function documentOf(run) {
  if (!run) return null;
  if (!documents.has(run)) {
    documents.set(run, null);
    get(`/api/runs/${encodeURIComponent(run)}`).then((doc) => { documents.set(run, doc); changed(); }, (error) => say(error.message, "poor"));
  }
  return documents.get(run);
}

/** Start a verb on the chosen records with the current model, and show it. */
export async function runVerb(verb, more = {}) {
  const job = await startJob({ verb, records: chosenRecords().map((record) => record.id), ...more });
  if (job) {
    update({ shownJob: job.id });
    finished(job);
  }
  return job;
}

async function finished(job) {
  const end = await ended(job);
  if (end.phase === "failed") say(`${words(end.verb)}: ${end.error || "it failed"}`, "poor");
  else if (end.phase === "finished" && !location.hash.includes("diagnose") && ["diagnose", "add"].includes(end.verb)) {
    say(`${end.title} is done.`, "good", { text: "Look at it", run: () => { update({ shownJob: end.id }); open("diagnose"); } });
  }
}

/** Ask what the model lacks, with this record. */
export async function diagnoseRecord(record) {
  update({ chosenRecords: [record.id] });
  open("diagnose");
  await diagnose();
}

/** Ask what the model lacks, with the records that are chosen. */
export const diagnose = () => runVerb("diagnose", state.quick ? { quick: true } : {});

/** The newest diagnosis that has a result, if the model is still the one it judged. */
export function lastDiagnosis() {
  const job = state.jobs.find((one) => one.verb === "diagnose" && one.phase === "finished" && one.run);
  return job && job.model === state.bench.current_model?.id ? job : null;
}

/** The effect to add first: what the verdict names and the model does not have. */
export function bestAddable(job) {
  const doc = job && documentOf(job.run);
  if (!doc || !["missing", "indistinguishable"].includes(doc.verdict.kind)) return null;
  const has = state.bench.current_model?.effects ?? [];
  const names = doc.verdict.effects.filter((name) => !has.includes(name));
  return doc.effects.find((effect) => names.includes(effect.name))?.name ?? names[0] ?? null;
}

/** Join an effect to the model; it is refitted to the records of the diagnosis. */
export async function addEffect(job, effect) {
  open("diagnose");
  return runVerb("add", { effect, model: job.model, records: job.records });
}

/** Make the model that a verdict names the current one. */
export const applyVerdict = (run) => attempt(() => post(`/api/runs/${encodeURIComponent(run)}/apply`));

/** Design the experiment that tells apart what these records cannot; its plan goes to the experiment tab. */
export async function nextExperiment(job) {
  const before = new Set(state.plans.map((plan) => plan.id));
  const started = await runVerb("next_experiment", { run: job.run, records: job.records });
  if (!started) return;
  const end = await ended(started);
  if (end.phase !== "finished") return;
  await refresh("plans");
  const plan = state.plans.find((one) => !before.has(one.id));
  if (!plan) return;
  update({ plan: plan.id });
  say(`Its plan ${plan.name} is ready.`, "good", { text: "To the experiment", run: () => open("experiment") });
}

export const anyRuns = () => state.jobs.some((job) => runs(job));

// What the user can do to the bench from more than one place of the page.
import { html, nothing } from "./html.js";
import { post } from "./api.js";
import { state, update } from "./store.js";
import { ask } from "./dialogs.js";
import { attempt, say } from "./messages.js";

/** Whether this page may change anything but the emergency stop. */
export const operates = () => state.online && state.role === "operate";

export const plant = () => state.bench.plant || { kind: "none", phase: "stopped", faults: [] };
export const plantRuns = () => plant().kind !== "none" && plant().phase === "running";
/** Whether something could move: then the space bar stops it. */
export const stoppable = () => plant().kind !== "none" && plant().phase !== "stopped";

/** Go to a tab. */
export function open(tab) {
  location.hash = `#/${tab}`;
}

/** Enable the plant after saying what that will do. */
export async function enable() {
  const { enable_does: does, name, kind } = plant();
  const real = kind === "can" || kind === "attached";
  const agreed = await ask({
    title: `Enable ${name || "the plant"}?`,
    body: html`
      <p>${does || "Commands will move the actuator."}</p>
      ${real ? html`<p class="notice poor">This may be real hardware. Nobody may be near the moving parts.</p>` : nothing}
      <p class="soft">The space bar, or STOP at the top, takes the drive to 0 V at any time.</p>`,
    yes: "Enable",
  });
  if (!agreed) return;
  const answer = await attempt(() => post("/api/plant/enable", { on: true }));
  if (answer && !answer.ok) say(answer.message || "The plant refused to be enabled.", "poor");
}

/** Take the drive to 0 V without a latch. */
export async function disable() {
  const answer = await attempt(() => post("/api/plant/enable", { on: false }));
  if (answer && !answer.ok) say(answer.message || "The plant refused to be disabled.", "poor");
}

/** Release the latched stop after saying what that will do. */
export async function reset() {
  const agreed = await ask({
    title: "Reset the emergency stop?",
    body: html`<p>${plant().reset_does || "The latch is released. The actuator stays disabled until you enable it."}</p>`,
    yes: "Reset",
  });
  if (!agreed) return;
  const answer = await attempt(() => post("/api/plant/reset"));
  if (answer && !answer.ok) say(answer.message || "The plant refused the reset.", "poor");
}

/** Start a verb as a job; the job, or null. */
export async function startJob(request) {
  const answer = await attempt(() => post("/api/jobs", request));
  if (!answer) return null;
  update({ jobs: [answer.job, ...state.jobs.filter((job) => job.id !== answer.job.id)] });
  return answer.job;
}

export const cancelJob = (job) => attempt(() => post(`/api/jobs/${encodeURIComponent(job.id)}/cancel`));
export const jobOf = (id) => state.jobs.find((job) => job.id === id);
export const runs = (job) => job && (job.phase === "running" || job.phase === "queued");
export const modelOf = (id) => state.models.find((model) => model.id === id);
export const recordOf = (id) => state.records.find((record) => record.id === id);

/** Wait for the end of a job, or for its first `phase` other than running. */
export function ended(job) {
  const now = jobOf(job.id);
  if (now && !runs(now)) return Promise.resolve(now);
  return new Promise((resolve) => {
    function listen({ detail }) {
      if (detail.id !== job.id || runs(detail)) return;
      removeEventListener("job-phase", listen);
      resolve(detail);
    }
    addEventListener("job-phase", listen);
  });
}

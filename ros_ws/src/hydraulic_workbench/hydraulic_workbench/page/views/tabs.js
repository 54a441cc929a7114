// The tabs in the order of the loop. Each view is a function that gives a template.
import { html, nothing } from "../core/html.js";
import { state } from "../core/store.js";
import { diagnoseIcon, experimentIcon, liveIcon, plantIcon, recordsIcon } from "../core/icons.js";
import { cancelJob, operates, runs } from "../core/actions.js";
import { words } from "../core/format.js";

export const TABS = [
  { name: "plant", title: "Plant", icon: plantIcon, purpose: "choose a simulator, a virtual bench or a real one" },
  { name: "live", title: "Live", icon: liveIcon, purpose: "watch it, beside its model; turn the controller's gains" },
  { name: "experiment", title: "Experiment", icon: experimentIcon, purpose: "choose a drive, rehearse it on the model, run it" },
  { name: "records", title: "Records", icon: recordsIcon, purpose: "bring your own measurements; lay two over each other" },
  { name: "diagnose", title: "Diagnose", icon: diagnoseIcon, purpose: "see where the model fails, what it lacks, and add that" },
];

export const currentTab = () => {
  const name = location.hash.replace(/^#\/?/, "").split("/")[0];
  return TABS.some((tab) => tab.name === name) ? name : "plant";
};

function runningJob(job) {
  return html`<div class="job">
    <div class="row"><i class="spinner"></i><span class="what" title=${job.title}>${words(job.verb)}</span>
      <button class="small quiet icon" ?disabled=${!operates()} @click=${() => cancelJob(job)}
        aria-label=${`Cancel ${job.title}`} title="Cancel">×</button></div>
    <span class="says" title=${job.progress || ""}>${job.progress || job.phase}</span>
  </div>`;
}

export function rail() {
  const now = currentTab();
  const busy = state.jobs.filter(runs);
  const count = { records: state.records.length || nothing };
  return html`<nav class="rail" aria-label="Tabs">
    ${TABS.map((tab) => html`
      <a href=${`#/${tab.name}`} aria-current=${now === tab.name ? "page" : "false"} title=${tab.purpose}>
        ${tab.icon()}<span>${tab.title}</span>
        ${count[tab.name] ? html`<span class="count">${count[tab.name]}</span>` : nothing}
      </a>`)}
    ${busy.length ? html`<div class="jobs" aria-label="Running work">${busy.map(runningJob)}</div>` : nothing}
  </nav>`;
}

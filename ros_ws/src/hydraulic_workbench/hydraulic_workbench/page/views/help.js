// What the page is for and which keys it knows.
import { html } from "../core/html.js";
import { ask } from "../core/dialogs.js";
import { TABS } from "./tabs.js";

const KEYS = [
  ["space", "emergency stop, while a plant runs (not while you type in a field)"],
  ["1 … 5", "the tabs, in their order"],
  ["P", "pause and follow the live plots"],
  ["+ −", "a shorter or longer live window"],
  ["Esc", "back to the whole plot; close a question"],
  ["?", "this page"],
];

export function showHelp() {
  return ask({
    title: "The loop",
    body: html`
      <ol class="loop">${TABS.map((tab) => html`<li><strong>${tab.title}</strong> <span class="soft">${tab.purpose}</span></li>`)}</ol>
      <h3 style="margin-top:10px">Keys</h3>
      <dl class="keys">${KEYS.map(([key, does]) => html`<dt><kbd>${key}</kbd></dt><dd>${does}</dd>`)}</dl>
      <p class="soft small">While a plant runs, Enter presses a button and ticks a box: the space bar is the stop.</p>`,
    yes: "Close",
    no: null,
  });
}

// The keyboard: the space bar is the emergency stop while a plant runs.
import { state } from "./store.js";
import { emergencyStop } from "./connection.js";
import { open, stoppable } from "./actions.js";
import { closeDialog } from "./dialogs.js";
import { showHelp } from "../views/help.js";
import { TABS } from "../views/tabs.js";

const TEXT = new Set(["text", "number", "search", "email", "url", "password", ""]);

function types(target) {
  if (target.isContentEditable || target.tagName === "TEXTAREA") return true;
  return target.tagName === "INPUT" && TEXT.has(target.getAttribute("type") ?? "");
}

const stops = (event) => event.code === "Space" && !event.ctrlKey && !event.metaKey && !event.altKey
  && stoppable() && !types(event.target);

function down(event) {
  if (stops(event)) {
    event.preventDefault(); // and presses no button
    event.stopImmediatePropagation();
    if (event.repeat) return;
    closeDialog(false);
    emergencyStop();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || types(event.target) || event.target.tagName === "SELECT") return;
  const box = event.target.tagName === "INPUT" && ["checkbox", "radio"].includes(event.target.type);
  if (event.key === "Enter" && box) event.target.click();
  if (state.dialog) return;
  const tab = TABS[Number(event.key) - 1];
  if (tab) open(tab.name);
  else if (event.key === "?") showHelp();
  else liveKey(event);
}

function liveKey(event) {
  const strips = document.querySelector("live-strips");
  if (!strips) return;
  if (event.key === "p" || event.key === "P") strips.paused ? strips.follow() : strips.pause();
  else if (event.key === "Escape") strips.follow();
  else if (event.key === "+") strips.setWindow(Math.max(1, strips.window / 2));
  else if (event.key === "-") strips.setWindow(Math.min(60, strips.window * 2));
}

/** Listen; the stop before everything else on the page. */
export function listenToKeys() {
  addEventListener("keydown", down, { capture: true });
  addEventListener("keyup", (event) => {
    if (!stops(event)) return;
    event.preventDefault(); // a button is pressed when the bar comes up
    event.stopImmediatePropagation();
  }, { capture: true });
}

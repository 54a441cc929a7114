// One question at a time: what will happen, and whether to do it.
import { html, nothing, ref } from "./html.js";
import { state, changed } from "./store.js";

state.dialog = null;

/** Ask; true if the user agrees. `body` is a template, `danger` colours the answer. */
export function ask({ title, body, yes, no = "Cancel" }) {
  closeDialog(false);
  return new Promise((resolve) => {
    state.dialog = { title, body, yes, no, resolve };
    changed();
  });
}

/** End the question that is open, if any. */
export function closeDialog(answer) {
  const dialog = state.dialog;
  if (!dialog) return;
  state.dialog = null;
  changed();
  dialog.resolve(answer);
}

function opened(element) {
  if (element) queueMicrotask(() => element.isConnected && !element.open && element.showModal());
}

export function dialogs() {
  const dialog = state.dialog;
  if (!dialog) return nothing;
  return html`<dialog aria-labelledby="dialog-title" ${ref(opened)} @close=${() => closeDialog(false)}
      @cancel=${() => closeDialog(false)}>
    <h2 id="dialog-title">${dialog.title}</h2>
    <div class="stack tight" style="margin-top:10px">${dialog.body}</div>
    <div class="actions">
      ${dialog.no ? html`<button @click=${() => closeDialog(false)}>${dialog.no}</button>` : nothing}
      <button class="primary" autofocus @click=${() => closeDialog(true)}>${dialog.yes}</button>
    </div>
  </dialog>`;
}

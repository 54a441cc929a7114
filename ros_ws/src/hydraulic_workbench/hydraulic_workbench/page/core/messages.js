// Short messages at the edge of the page; errors stay until they are closed.
import { html, repeat, nothing } from "./html.js";
import { state, changed } from "./store.js";

state.messages = [];
let number = 0;

/** Say something: kind "info", "good" or "poor"; `action` is {text, run}. */
export function say(text, kind = "info", action = null) {
  if (state.messages.some((message) => message.text === text)) return;
  const message = { id: ++number, text, kind, action };
  state.messages = [...state.messages.slice(-3), message];
  changed();
  if (kind !== "poor") setTimeout(() => close(message), action ? 12000 : 5000);
}

function close(message) {
  state.messages = state.messages.filter((other) => other !== message);
  changed();
}

/** Run something that asks the server; what it refuses is said. Gives the answer, or null. */
export async function attempt(work) {
  try {
    return await work();
  } catch (error) {
    say(error.message, "poor");
    if (!error.status && error.name !== "ApiError") console.error(error);
    return null;
  }
}

export function messages() {
  return html`<div class="messages" role="status" aria-live="polite">
    ${repeat(state.messages, (message) => message.id, (message) => html`
      <div class="message ${message.kind}">
        <div>
          <span>${message.text}</span>
          ${message.action
            ? html`<button class="small" @click=${() => { close(message); message.action.run(); }}>${message.action.text}</button>`
            : nothing}
        </div>
        <button class="close" aria-label="Close message" @click=${() => close(message)}>×</button>
      </div>`)}
  </div>`;
}

// What the page knows, in one place. A change draws the page again, once per frame.

const listeners = new Set();
let waiting = false;

/** Everything that views show; live samples are elsewhere, they come too often. */
export const state = {};

/** Take over some values and draw the page again. */
export function update(patch) {
  Object.assign(state, patch);
  changed();
}

/** Draw again: something inside the state has changed. */
export function changed() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    for (const listener of listeners) listener(state);
  });
}

/** Call `listener` whenever something has changed. */
export function onChange(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

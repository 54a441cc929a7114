// Line drawings, 24 × 24, in the colour of the text around them. Decoration only: words stand beside each.
import { svg, html } from "./html.js";

const icon = (shape) => html`<svg viewBox="0 0 24 24" fill="none" stroke="currentColor" stroke-width="1.8"
  stroke-linecap="round" stroke-linejoin="round" aria-hidden="true">${shape}</svg>`;

export const brand = html`<svg viewBox="0 0 32 32" aria-hidden="true">
  <rect width="32" height="32" rx="8" fill="var(--accent)"/>
  <g fill="none" stroke="var(--on-accent)" stroke-width="2.2" stroke-linecap="round">
    <rect x="5.5" y="11" width="14" height="10" rx="2"/><path d="M12 11v10M12 16h14.5M26.5 13v6"/></g></svg>`;
export const plantIcon = () => icon(svg`<rect x="3" y="8" width="11" height="8" rx="1.5"/><path d="M8 8v8M8 12h12M20 9v6"/>`);
export const liveIcon = () => icon(svg`<path d="M3 12h4l2.5-7 4 14 2.5-7h5"/>`);
export const experimentIcon = () => icon(svg`<path d="M9 3h6M10 3v6L4.6 18a2 2 0 0 0 1.7 3h11.4a2 2 0 0 0 1.7-3L14 9V3M7.5 15h9"/>`);
export const recordsIcon = () => icon(svg`<rect x="4" y="3" width="16" height="18" rx="2"/><path d="M7.5 13.5l3-4 3 5 3-3.5M8 18h8"/>`);
export const diagnoseIcon = () => icon(svg`<circle cx="10.5" cy="10.5" r="6.5"/><path d="M15.5 15.5L21 21M7.5 10.5h1.7l1.3-2.5 1.5 5 1-2.5h1"/>`);
export const theme = () => icon(svg`<circle cx="12" cy="12" r="8.5"/><path d="M12 3.5v17a8.5 8.5 0 0 0 0-17z" fill="currentColor"/>`);
export const pauseIcon = () => icon(svg`<path d="M8.5 5v14M15.5 5v14"/>`);
export const playIcon = () => icon(svg`<path d="M8 5l11 7-11 7z"/>`);
export const undoIcon = () => icon(svg`<path d="M9 7L4 12l5 5M4 12h10a6 6 0 0 1 6 6v1"/>`);
export const helpIcon = () => icon(svg`<circle cx="12" cy="12" r="9"/><path d="M9.4 9.3a2.7 2.7 0 1 1 3.8 2.6c-.9.4-1.2.9-1.2 1.8M12 16.9v.1"/>`);
export const uploadIcon = () => icon(svg`<path d="M12 15V4M7.5 8.5L12 4l4.5 4.5M4 15v4a1.5 1.5 0 0 0 1.5 1.5h13A1.5 1.5 0 0 0 20 19v-4"/>`);
export const checkIcon = () => icon(svg`<path d="M5 12.5l4.5 4.5L19 7.5"/>`);
export const crossIcon = () => icon(svg`<path d="M6 6l12 12M18 6L6 18"/>`);
export const warnIcon = () => icon(svg`<path d="M12 4l9 16H3zM12 10v4.5M12 17.2v.1"/>`);
export const lockIcon = () => icon(svg`<rect x="5" y="11" width="14" height="9" rx="2"/><path d="M8.5 11V8a3.5 3.5 0 0 1 7 0v3"/>`);
export const zoomOut = () => icon(svg`<path d="M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5"/>`);

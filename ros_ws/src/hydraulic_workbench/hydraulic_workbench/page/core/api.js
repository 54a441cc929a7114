// Calls of the server. What it answers is JSON; an error carries the server's sentence and the field it is about.

export class ApiError extends Error {
  constructor(message, status, field) {
    super(message);
    this.status = status;
    this.field = field;
  }
}

async function call(method, path, body, type) {
  const options = { method, credentials: "same-origin", headers: {} };
  if (body !== undefined) {
    options.body = type ? body : JSON.stringify(body);
    options.headers["Content-Type"] = type || "application/json";
  }
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new ApiError("The workbench server does not answer.", 0, null);
  }
  const text = await answer.text();
  let data = null;
  try {
    data = text ? JSON.parse(text) : {};
  } catch {
    data = { error: text.slice(0, 300) };
  }
  if (!answer.ok) throw new ApiError(data.error || `${answer.status} ${answer.statusText}`, answer.status, data.field);
  return data;
}

export const get = (path) => call("GET", path);
export const post = (path, body = {}) => call("POST", path, body);
export const remove = (path) => call("DELETE", path);
/** Raw bytes of a file. */
export const put = (path, bytes) => call("PUT", path, bytes, "application/octet-stream");

/** A path from parts that come from outside. */
export const path = (...parts) => "/" + parts.map(encodeURIComponent).join("/");

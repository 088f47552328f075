// Where the page asks its questions: the server of `sar-compile edit`, whose access token is in the address.
export class Server {
  constructor(token) {
    this.token = token;
  }

  async ask(question, values = {}) {
    const headers = { "Content-Type": "application/json", Authorization: `Bearer ${this.token}` };
    const answer = await fetch(`ask/${question}`, { method: "POST", headers, body: JSON.stringify(values) }).catch(() => null);
    if (!answer) return { error: "The program that serves this page has ended. Copy your text, and start it again" };
    if (answer.status === 403) return { error: "Open the complete address that sar-compile edit has printed" };
    return answer.ok ? answer.json() : { error: `The server refused the question (${answer.status})` };
  }
}

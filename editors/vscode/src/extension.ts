// Starts the language server that `sar-compile lsp` is; all that is known of trees is known there.

import { ExtensionContext, workspace } from "vscode";
import { LanguageClient } from "vscode-languageclient/node";

let client: LanguageClient | undefined;

export async function activate(_context: ExtensionContext): Promise<void> {
  const [command, ...args] = workspace.getConfiguration("sar").get<string[]>("command", ["sar-compile", "lsp"]);
  client = new LanguageClient("sar", "Behaviour trees", { command, args }, {
    documentSelector: ["xml", "yaml"].map((language) => ({ scheme: "file", language })),
    // What a tree depends on besides open files: settings, palettes, modules of leaves.
    synchronize: { fileEvents: workspace.createFileSystemWatcher("**/*.{toml,xml,yaml,yml,btproj,py}") },
  });
  await client.start();
}

export async function deactivate(): Promise<void> {
  await client?.stop();
}

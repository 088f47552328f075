// Python in the page: Pyodide with the package, both from the site itself. `read` returns the bytes of one of its files.
export async function start(loadPyodide, options, read) {
  const python = await loadPyodide({ ...options, env: { SAR_KERNEL: "python", HOME: "/home/pyodide" } });
  python.FS.writeFile("/tmp/packages.zip", await read("packages.zip"));
  python.runPython(`
import sys, sysconfig, zipfile
sys.dont_write_bytecode = True
zipfile.ZipFile("/tmp/packages.zip").extractall(sysconfig.get_path("purelib"))
import site_engine
`);
  const answer = python.globals.get("site_engine").answer;
  return (question, values, onProgress) => JSON.parse(answer(question, JSON.stringify(values ?? {}), onProgress));
}

// The worker: Python with numpy and shrm_cli, apart from the page, which stays responsive.

const SETUP = `
import os, sys
sys.path[:0] = ["/packages", "/packages/lib/python3.11/site-packages"]
os.environ["SHRM_CACHE_DIR"] = "/tmp/shrm"
os.mkdir("/tmp/shrm", 0o700)
`;

importScripts('pyodide/pyodide.asm.js', 'pyodide/pyodide.js');

// numpy asks for its callers by `backtrace` before it reuses the memory of temporaries. This build
// of Python has no such function; that there are no callers makes numpy leave the memory alone.
const make = _createPyodideModule;
_createPyodideModule = module => {
  module.adjustWasmImports = imports => { imports.backtrace ??= () => 0; };
  return make(module);
};

async function start() {
  const python = await loadPyodide({ indexURL: 'pyodide/' });
  for (const [name, format] of [['numpy.tar.gz', 'gztar'], ['shrm.zip', 'zip']])
    python.unpackArchive(await (await fetch(name)).arrayBuffer(), format, { extractDir: '/packages' });
  python.runPython(SETUP + (await (await fetch('prefilter.py')).text()));
  return python;
}

const started = start();
started.then(
  python => postMessage({ what: 'ready', engines: JSON.parse(python.globals.get('engines')()) }),
  error => postMessage({ what: 'failed', text: `The filter could not be loaded: ${error.message}` }),
);

onmessage = async ({ data: { name, image, width, height, engine, size } }) => {
  const python = await started, begun = performance.now();
  const report = (done, total) => postMessage({ what: 'progress', done, total });
  let files, told, error;
  try {
    [files, told, error] = python.globals.get('made')(
      name, image, width, height, engine, size, report,
    ).toJs();
  } catch (unforeseen) {
    error = `It could not be made: ${unforeseen.message.trim().split('\n').pop()}`;
  }
  if (error) postMessage({ what: 'failed', text: error });
  else postMessage({
    what: 'made', told, seconds: (performance.now() - begun) / 1000,
    files: files.map(([name, bytes]) => ({ name, bytes })),
  });
};

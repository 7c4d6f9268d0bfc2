// Every element of the class shrm-view becomes a view. `window.shrm.views` holds them for scripts:
// view.set({...}) changes the state, view.read(size, side) returns radiance, and view.ready is a
// promise of it.

function fail(root, message) {
  var place = root.querySelector(".problem");
  place.textContent = message;
  place.hidden = false;
  root.dataset.state = "failed";
}

function start(root) {
  var scene = describedScene(root);
  return loadBlocks(root, scene).then(function (blocks) {
    var viewer = new Viewer(root, scene, blocks);
    if (scene.start.exposure === null) {
      scene.start.exposure = viewer.suitableExposure();
      viewer.state = startState(scene);
    }
    var controls = new Controls(viewer);
    listenToKeys(viewer, controls);
    listenToPointers(viewer, controls);
    viewer.drawFirst();
    controls.drawn();
    root.dataset.state = "ready";
    return viewer;
  }).catch(function (error) {
    fail(root, error.message);
    throw error;
  });
}

window.shrm = {
  views: Array.from(document.querySelectorAll(".shrm-view")).map(start),
};

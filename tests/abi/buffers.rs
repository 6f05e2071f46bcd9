//! What comes out of a fixed scene.

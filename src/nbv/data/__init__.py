"""From meshes to depth images: objects, cameras, renderers and sensors."""

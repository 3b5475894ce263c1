"""What is drawn anywhere: how MuJoCo renders without harm, marks in its scenes, and bodies as triangles."""

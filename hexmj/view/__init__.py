"""Views of live walks and recordings, in a browser and in MuJoCo's viewer."""

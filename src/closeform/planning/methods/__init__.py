"""Methods of planning beside the joint optimum: craft by craft, by messages, and that of SP11."""

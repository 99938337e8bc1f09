"""Methods of planning beside the joint optimum: craft by craft, by messages, and those of SP11."""

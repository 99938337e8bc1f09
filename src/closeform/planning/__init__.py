"""Path planning: minimum-cost paths of a formation, certified clear of all keep-out zones."""

"""numba in a process of our own: loaded in less time, and made to look up and to write less."""

from closeform import own_process

KNOWN = (0, 61), (0, 68)  # the first and the last of its versions whose own functions are replaced


def prepare_numba() -> None:
    """Load numba and have kernels compile in half the time; an unknown version compiles as it is."""
    own_process.import_numba()
    from numba import version_info

    if KNOWN[0] <= version_info.short <= KNOWN[1]:
        from closeform import kernel_calls, kernel_memory, kernel_variables, kernel_writing

        kernel_memory.remember()
        kernel_writing.write_less()
        kernel_calls.pass_errors_on()
        kernel_variables.keep_values()

/* Of the code generator: nothing that a check of names needs. */

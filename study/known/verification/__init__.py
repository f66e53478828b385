"""Problems with exact solutions, solved by the reference's own code: `liver-study verify`."""

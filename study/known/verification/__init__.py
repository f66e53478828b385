"""Problems with known answers, solved by the reference as a scene is: `liver-study verify`."""

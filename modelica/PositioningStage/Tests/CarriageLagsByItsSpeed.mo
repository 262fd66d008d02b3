within PositioningStage.Tests;
model CarriageLagsByItsSpeed "On a ramp the carriage is speed/kp late; viscous friction adds its command"
  Stage free(goal=0.1*time, pulse=0.0, df0=0.0);
  Stage viscous(goal=0.1*time, pulse=0.0, df0=0.0, redeclare Effects.ViscousFriction friction(damping=200.0));
equation
  // kp*(goal - q) = speed + command/kv; the command is friction/gtau. All starts fade in 50 ms.
  assert(time < 1.0 or abs(0.1*time - free.q - 0.1/160.18) < 1e-8, "Not late by speed/kp");
  assert(time < 1.0 or abs(viscous.command - 20.0/35.15065188248547) < 1e-5,
    "The command does not bear the friction");
  assert(time < 1.0 or abs(0.1*time - viscous.q - (0.1 + viscous.command/243.45)/160.18) < 1e-8,
    "Not late by what the command needs");
  annotation (experiment(StopTime=2.0, Tolerance=1e-9));
end CarriageLagsByItsSpeed;

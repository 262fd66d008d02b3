within Effects.Friction;
model Frictionless "Null version: nothing resists"
  extends Interfaces.Friction;
equation
  f = 0.0;
end Frictionless;

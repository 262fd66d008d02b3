within WheelsetRig.Contact;
partial model PartialAdhesion "Slot: what changes the friction between wheel and roller"
  input Units.FrictionCoefficient level "Friction at zero slip velocity, as set by model and observer";
  input Units.Velocity w "Slip velocity";
  input Units.Velocity v "Rolling velocity";
  input Units.Force Fx "Creep force of one wheel";
  output Units.FrictionCoefficient mu0 "Friction at zero slip velocity that acts";
end PartialAdhesion;

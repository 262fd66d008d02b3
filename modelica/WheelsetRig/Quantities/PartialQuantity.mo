within WheelsetRig.Quantities;
partial model PartialQuantity "What changes a quantity of the rig; each slot has a class of its own"
  extends Common.Interfaces.Signal;
  input Units.AngularVelocity omega "Angular velocity of the body it belongs to";
end PartialQuantity;

within WheelsetRig.Quantities;
partial model PartialQuantity "What changes a quantity of the rig; each slot has a class of its own"
  input Real nominal "Nominal value, in the unit of the quantity";
  input Units.AngularVelocity omega "Angular velocity of the body it belongs to";
  output Real actual "Value that acts, in the same unit";
end PartialQuantity;

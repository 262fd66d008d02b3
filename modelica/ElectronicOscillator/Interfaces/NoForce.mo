within ElectronicOscillator.Interfaces;
model NoForce "Null version: nothing else pulls"
  extends PartialForce;
equation
  f = 0.0;
end NoForce;

within WheelsetRig.Contact;
model ConstantAdhesion "Null version: friction at zero slip does not depend on anything"
  extends PartialAdhesion;
equation
  mu0 = level;
end ConstantAdhesion;

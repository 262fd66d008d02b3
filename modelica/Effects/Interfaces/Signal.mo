within Effects.Interfaces;
partial model Signal "Slot: from a value to the one that acts, or is read"
  input Real u "Nominal or true value";
  output Real y "Value that acts or is read, in the same unit";
  annotation (Documentation(info="<html>
<p>Several effects in such a slot form a chain: <code>y</code> of one is <code>u</code> of the
next.</p>
</html>"));
end Signal;

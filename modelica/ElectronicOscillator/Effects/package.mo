within ElectronicOscillator;
package Effects "Catalogue: what the linear oscillator leaves out"
  annotation (Documentation(info="<html>
<p>What matters: some 0.1 mV of a displacement of 0.2 V.</p>
</html>"));
end Effects;

within HeatedHouse;
package Effects "Catalogue: what the simplest house leaves out"
  annotation (Documentation(info="<html>
<p>What matters: a tenth of a kelvin.</p>
</html>"));
end Effects;
